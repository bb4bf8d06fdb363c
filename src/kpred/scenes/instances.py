"""Numbers that say which points of a scene belong to one object."""

from __future__ import annotations

import math
import zipfile
from pathlib import Path

import numpy as np

from kpred.errors import ScanError
from kpred.shapes.formats.ply_elements import Columns, PlyLists
from kpred.shapes.formats.records import number_of
from kpred.shapes.formats.scan_array import array_header, check_expansion
from kpred.shapes.formats.scene_ply import vertex_columns
from kpred.shapes.formats.text_lines import open_lines
from kpred.shapes.reading import check_file, reading

INSTANCE_PROPERTIES = (
    *("instance", "instance_id", "instances", "object_id", "objectid", "obj_id", "inst", "instanceid"),
    *("instance_label", "ins_label", "instance_ids", "instance_labels", "object", "pred_instance"),
)
_ARRAYS = (*INSTANCE_PROPERTIES, "labels")
LABEL_PROPERTIES = ("label", "nyu40", "nyu40id")
TEXT_EXTENSIONS = (".xyz", ".txt", ".csv", ".asc", ".pts", ".labels")

_BLANKS = bytes.maketrans(b",;", b"  ")

_MAX_NUMBER = 2**53
"""Beyond it not all whole numbers are floats."""


def instance_numbers(file: Path, count: int) -> np.ndarray:
    """Read the instance numbers of all points of a scene, (count,) int64.

    Raises:
        ScanError: unreadable, no whole numbers, or another count of them.
    """
    check_file(file, ScanError, "file of objects")
    with reading(file, ScanError, "file of instance numbers"):
        flat = np.asarray(_raw_numbers(file)).reshape(-1)
    if flat.dtype.kind == "f":
        flat = np.nan_to_num(flat, nan=-1, posinf=-1, neginf=-1)
        if (flat != np.round(flat)).any() or (np.abs(flat) >= _MAX_NUMBER).any():
            raise ScanError(f"{file}: its numbers are not whole; give one instance number a point.")
    elif flat.dtype.kind not in "iub":
        raise ScanError(f"{file}: it holds {flat.dtype}, not numbers; give one instance number a point.")
    if len(flat) != count:
        raise ScanError(f"{file}: it labels {len(flat)} points, but the scene has {count}; give labels of that scene.")
    return flat.astype(np.int64)


def column_numbers(columns: Columns, names: tuple[str, ...]) -> np.ndarray | None:
    """Return the first present property of these, (N,) int64; NaN and infinite numbers become -1."""
    for name in names:
        # CloudCompare writes scalar_ before names.
        column = columns.get(name, columns.get(f"scalar_{name}"))
        if column is not None and not isinstance(column, PlyLists):
            finite = np.nan_to_num(column, nan=-1, posinf=-1, neginf=-1)
            return np.where(np.abs(finite) < _MAX_NUMBER, finite, -1).astype(np.int64)
    return None


def instances_of_faces(faces: Columns, count: int) -> np.ndarray | None:
    """Return transfer numbers of faces to vertices (count,) int64, as in Replica; -1 for none."""
    numbers = column_numbers(faces, INSTANCE_PROPERTIES)
    lists = next((item for name, item in faces.items() if isinstance(item, PlyLists) and name.startswith("vert")), None)
    if numbers is None or lists is None:
        return None
    corners = lists.values.astype(np.int64)
    inside = (corners >= 0) & (corners < count)
    found = np.full(count, -1, dtype=np.int64)
    found[corners[inside]] = np.repeat(numbers, lists.sizes)[inside]
    return found


def _raw_numbers(file: Path) -> np.ndarray:
    extension = file.suffix.lower()
    if extension == ".npy":
        with open(file, "rb") as stream:
            shape, _, dtype = array_header(stream, str(file))
        if math.prod(shape) * dtype.itemsize > file.stat().st_size:
            raise ScanError(f"{file}: an array of shape {shape} is not in it (damaged or cut short); copy it again.")
        return np.asarray(np.load(file, allow_pickle=False))
    if extension == ".npz":
        return _of_archive(file)
    if extension == ".ply":
        columns = vertex_columns(file)
        found = [name for name in (*INSTANCE_PROPERTIES, *LABEL_PROPERTIES) if name in columns]
        if not found:
            raise ScanError(f"{file}: it holds no instance numbers; give one whole number a point.")
        return columns[found[0]]
    if extension in TEXT_EXTENSIONS:
        with open_lines(file) as lines:
            words = [word for line in lines for word in line.split(b"#", 1)[0].translate(_BLANKS).split()]
        return np.array([number_of(word) for word in (words[1:] if _is_title(words) else words)])
    raise ScanError(f"{file}: objects are given as .npy, .npz, .txt, .ply or .json; unknown extension {extension!r}.")


def _is_title(words: list[bytes]) -> bool:
    """Test whether the first word names the column."""
    return bool(words) and words[0].strip(b"\"'").lower().decode("latin-1") in (*_ARRAYS, "label", "id")


def _of_archive(file: Path) -> np.ndarray:
    with zipfile.ZipFile(file) as archive:
        names = [name.removesuffix(".npy") for name in archive.namelist()]
        known = [name for name in _ARRAYS if name in names]
        if not known and len(names) != 1:
            raise ScanError(f"{file}: none of its arrays is named instances; name one so.")
        name = f"{(known or names)[0]}.npy"
        check_expansion(archive.getinfo(name), str(file))
        with archive.open(name) as stream:
            shape, _, dtype = array_header(stream, f"{file} ({name})")
            if math.prod(shape) * dtype.itemsize > archive.getinfo(name).file_size:
                raise ScanError(f"{file}: an array of shape {shape} is not in it (damaged, cut short); copy it again.")
    with np.load(file, allow_pickle=False) as arrays:
        return np.asarray(arrays[name.removesuffix(".npy")])
