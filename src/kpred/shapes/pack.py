"""Many meshes of one category in one npz file."""

from __future__ import annotations

import os
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from kpred.atomic import atomic_path
from kpred.errors import PackError
from kpred.ops.typing import Int
from kpred.shapes.mesh import Mesh
from kpred.shapes.reading import check_file, reading

_REQUIRED = ("vertices", "faces", "vertex_offsets", "face_offsets", "model_id", "split")
_MAX_RATIO = 64
_FREE_BYTES = 1 << 26
"""Bytes that one of a pack may expand to, beyond a first part: meshes do not compress so well."""

_KNOWN = (*_REQUIRED, "anno_id", "face_part", "part_names", "category")


@dataclass(frozen=True, eq=False)
class MeshPack:
    """Meshes one after the other in flat arrays; shape i owns rows offsets[i] .. offsets[i + 1] - 1.

    Attributes:
        vertices: (sumV, 3) float32.
        faces: (sumF, 3) int32, indices local to each shape.
        vertex_offsets, face_offsets: (N + 1,) int64.
        model_id, anno_id, split: (N,) str; split is source, train or val.
        category: one name for the whole pack.
        face_part: (sumF,) int16 part index of each face, or None.
        part_names: (P,) str, names of the part indices, or None.
        extra: further arrays of the file by name (``factory``, ``seed``, ...), kept as they are.

    Raises:
        PackError: the arrays do not fit together.
    """

    vertices: np.ndarray
    faces: np.ndarray
    vertex_offsets: np.ndarray
    face_offsets: np.ndarray
    model_id: np.ndarray
    anno_id: np.ndarray
    split: np.ndarray
    category: str
    face_part: np.ndarray | None = None
    part_names: np.ndarray | None = None
    extra: Mapping[str, np.ndarray] = field(default_factory=dict)

    def __post_init__(self) -> None:
        _check(self)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> MeshPack:
        """Read a pack; the category is its key ``category``, else the stem of the file's name.

        Raises:
            PackError: the file is missing, truncated, not an npz, or its arrays are not a pack's.
        """
        file = Path(path)
        check_file(file, PackError, ".npz file of a mesh pack")
        with reading(file, PackError):
            arrays = _arrays(file)
        missing = [name for name in _REQUIRED if name not in arrays]
        if missing:
            raise PackError(f"{file}: it is not a mesh pack, it lacks {', '.join(missing)}; give an .npz pack.")
        category = str(arrays["category"]) if "category" in arrays else file.stem
        try:
            return cls(
                vertices=np.asarray(arrays["vertices"], dtype=np.float32),
                faces=np.asarray(arrays["faces"], dtype=np.int32),
                vertex_offsets=np.asarray(arrays["vertex_offsets"], dtype=np.int64),
                face_offsets=np.asarray(arrays["face_offsets"], dtype=np.int64),
                model_id=arrays["model_id"].astype(str),
                anno_id=arrays.get("anno_id", np.full(arrays["model_id"].shape, "")).astype(str),
                split=arrays["split"].astype(str),
                category=category,
                face_part=None if "face_part" not in arrays else arrays["face_part"].astype(np.int16),
                part_names=None if "part_names" not in arrays else arrays["part_names"].astype(str),
                extra={name: array for name, array in arrays.items() if name not in _KNOWN},
            )
        except (ValueError, TypeError, OverflowError) as error:
            raise PackError(
                f"{file}: an array of the pack has a wrong type ({error}); write the pack again."
            ) from error
        except PackError as error:
            raise PackError(f"{file}: {error}") from error

    @classmethod
    def from_meshes(
        cls,
        meshes: Sequence[Mesh],
        model_ids: Sequence[str],
        splits: Sequence[str],
        category: str,
        *,
        part_names: Sequence[str] | None = None,
        extra: Mapping[str, np.ndarray] | None = None,
    ) -> MeshPack:
        """Put meshes one after the other. Faces of a mesh without parts get part -1 when another mesh has parts.

        Raises:
            PackError: the numbers of meshes, ids and splits differ.
        """
        if not len(meshes) == len(model_ids) == len(splits):
            raise PackError(f"{len(meshes)} meshes, {len(model_ids)} ids and {len(splits)} splits do not match.")
        parts = None
        if any(mesh.face_parts is not None for mesh in meshes):
            blocks = [
                np.full(len(mesh.faces), -1, dtype=np.int16) if mesh.face_parts is None else mesh.face_parts
                for mesh in meshes
            ]
            parts = np.concatenate(blocks)
        return cls(
            vertices=np.concatenate([np.zeros((0, 3), np.float32), *(mesh.vertices for mesh in meshes)]),
            faces=np.concatenate([np.zeros((0, 3), np.int32), *(mesh.faces for mesh in meshes)]),
            vertex_offsets=_offsets([len(mesh.vertices) for mesh in meshes]),
            face_offsets=_offsets([len(mesh.faces) for mesh in meshes]),
            model_id=np.array(model_ids, dtype=str),
            anno_id=np.full(len(meshes), ""),
            split=np.array(splits, dtype=str),
            category=category,
            face_part=parts,
            part_names=None if part_names is None else np.array(part_names, dtype=str),
            extra=dict(extra or {}),
        )

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the pack as a compressed npz, whole or not at all.

        Raises:
            OutputError: the file cannot be written there.
        """
        arrays: dict[str, np.ndarray] = dict(self.extra)
        for name in ("vertices", "faces", "vertex_offsets", "face_offsets", "model_id", "anno_id", "split"):
            arrays[name] = getattr(self, name)
        arrays["category"] = np.array(self.category)
        if self.face_part is not None:
            arrays["face_part"] = self.face_part
        if self.part_names is not None:
            arrays["part_names"] = self.part_names
        with atomic_path(path) as temporary, open(temporary, "xb") as stream:
            np.savez_compressed(stream, **arrays)  # type: ignore[arg-type]

    def __len__(self) -> int:
        return len(self.model_id)

    def __getitem__(self, index: int) -> Mesh:
        """Return mesh ``index``, named by its model id; its arrays are views where the types allow."""
        i = int(index)
        if not -len(self) <= i < len(self):
            raise IndexError(f"shape {i} of a pack of {len(self)}")
        i %= len(self)
        rows = slice(int(self.vertex_offsets[i]), int(self.vertex_offsets[i + 1]))
        face_rows = slice(int(self.face_offsets[i]), int(self.face_offsets[i + 1]))
        parts = None if self.face_part is None else self.face_part[face_rows]
        return Mesh(self.vertices[rows], self.faces[face_rows], str(self.model_id[i]), parts)

    def __iter__(self) -> Iterator[Mesh]:
        return (self[i] for i in range(len(self)))

    def indices(self, split: str | None = None) -> Int[np.ndarray, " shapes"]:
        """Return the indices (n,) int64 of the shapes of one split, or of all shapes."""
        if split is None:
            return np.arange(len(self))
        return np.flatnonzero(self.split == split)


def _offsets(counts: Sequence[int]) -> np.ndarray:
    return np.concatenate([[0], np.cumsum(counts, dtype=np.int64)]).astype(np.int64)


def _check(pack: MeshPack) -> None:
    count = len(pack.model_id) if pack.model_id.ndim == 1 else -1
    if count < 0 or pack.anno_id.shape != (count,) or pack.split.shape != (count,):
        raise PackError("model_id, anno_id and split must be lists of one length; write the pack again.")
    for name, rows, offsets in (
        ("vertices", pack.vertices, pack.vertex_offsets),
        ("faces", pack.faces, pack.face_offsets),
    ):
        if rows.ndim != 2 or rows.shape[1] != 3:
            raise PackError(f"{name} must have shape (n, 3), not {rows.shape}; write the pack again.")
        if offsets.shape != (count + 1,):
            raise PackError(f"the offsets of {name} must be {count + 1} numbers; write the pack again.")
        if offsets[0] != 0 or offsets[-1] != len(rows) or (np.diff(offsets) < 0).any():
            raise PackError(f"the offsets of {name} do not run from 0 to {len(rows)}; write the pack again.")
    if len(pack.faces):
        sizes = np.repeat(np.diff(pack.vertex_offsets), np.diff(pack.face_offsets))
        if pack.faces.min() < 0 or (pack.faces.max(axis=1) >= sizes).any():
            raise PackError("a face names a vertex outside its shape; write the pack again.")
    if pack.face_part is not None and pack.face_part.shape != (len(pack.faces),):
        raise PackError("face_part must have one entry a face; write the pack again.")
    if pack.face_part is None or pack.part_names is None or not len(pack.face_part):
        return
    if pack.face_part.min() < -1 or pack.face_part.max() >= len(pack.part_names):
        raise PackError("face_part names a part that part_names does not have; write the pack again.")


def _arrays(file: Path) -> dict[str, np.ndarray]:
    """Read all arrays of a pack, after a check of their declared sizes."""
    if not zipfile.is_zipfile(file):
        with open(file, "rb") as stream:
            single = stream.read(6) == b"\x93NUMPY"
        what = "a single array, not a mesh pack" if single else "not a readable .npz file (damaged or cut short)"
        raise PackError(f"{file}: it is {what}; give an .npz pack.")
    try:
        with zipfile.ZipFile(file) as archive:
            expanded = sum(item.file_size for item in archive.infolist())
            if expanded > _MAX_RATIO * file.stat().st_size + _FREE_BYTES:
                raise PackError(f"{file}: its {expanded / 1e9:.1f} GB are more than a pack of its size can hold.")
        with np.load(file, allow_pickle=False) as arrays:
            return {name: arrays[name] for name in arrays.files}
    except PackError:
        raise
    except Exception as error:  # A parser of foreign bytes may fail in any way.
        raise PackError(f"{file}: it is not a readable .npz file (damaged or cut short); copy it again.") from error


def concatenate(packs: Sequence[MeshPack], category: str | None = None) -> MeshPack:
    """Join packs to one pack of all shapes, in order.

    Part indices are renumbered into the union of the part names when every pack that has parts names them. An extra
    array is joined when every pack has it with one entry a shape; a str array missing in some packs is filled with "".
    Other extra arrays are kept when all packs hold the same.

    Raises:
        PackError: no packs, or differing categories and no ``category`` given.
    """
    if not packs:
        raise PackError("There is no pack to concatenate; give at least one.")
    names = sorted({pack.category for pack in packs})
    if category is None and len(names) > 1:
        raise PackError(f"The packs are of different categories ({', '.join(names)}); name the category of the result.")
    face_part, part_names = _joined_parts(packs)
    return MeshPack(
        vertices=np.concatenate([pack.vertices for pack in packs]),
        faces=np.concatenate([pack.faces for pack in packs]),
        vertex_offsets=_offsets([int(n) for pack in packs for n in np.diff(pack.vertex_offsets)]),
        face_offsets=_offsets([int(n) for pack in packs for n in np.diff(pack.face_offsets)]),
        model_id=np.concatenate([pack.model_id for pack in packs]),
        anno_id=np.concatenate([pack.anno_id for pack in packs]),
        split=np.concatenate([pack.split for pack in packs]),
        category=category if category is not None else names[0],
        face_part=face_part,
        part_names=part_names,
        extra=_joined_extra(packs),
    )


def _joined_parts(packs: Sequence[MeshPack]) -> tuple[np.ndarray | None, np.ndarray | None]:
    with_parts = [pack for pack in packs if pack.face_part is not None]
    if not with_parts:
        return None, None
    named = all(pack.part_names is not None for pack in with_parts)
    union: dict[str, int] = {}
    blocks = []
    for pack in packs:
        if pack.face_part is None:
            blocks.append(np.full(len(pack.faces), -1, dtype=np.int16))
        elif named and pack.part_names is not None:
            # Entry -1 (the last of the table) keeps faces without a part at -1.
            table = [union.setdefault(str(name), len(union)) for name in pack.part_names]
            blocks.append(np.array([*table, -1], dtype=np.int16)[pack.face_part])
        else:
            blocks.append(pack.face_part)
    return np.concatenate(blocks), np.array(list(union), dtype=str) if named else None


def _joined_extra(packs: Sequence[MeshPack]) -> dict[str, np.ndarray]:
    joined: dict[str, np.ndarray] = {}
    for name in dict.fromkeys(name for pack in packs for name in pack.extra):
        arrays = [pack.extra.get(name) for pack in packs]
        first = next(array for array in arrays if array is not None)
        if all(array is None or (array.ndim and len(array) == len(p)) for array, p in zip(arrays, packs, strict=True)):
            if first.dtype.kind == "U":
                filled = [np.full(len(p), "") if a is None else a for a, p in zip(arrays, packs, strict=True)]
                joined[name] = np.concatenate(filled)
            elif all(array is not None for array in arrays):
                joined[name] = np.concatenate([array for array in arrays if array is not None])
        elif all(array is not None and np.array_equal(array, first) for array in arrays):
            joined[name] = first
    return joined
