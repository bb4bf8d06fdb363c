"""A scanned scene: all its points, with labels, colours and faces where the files have them."""

from __future__ import annotations

import os
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kpred.errors import ConfigError, MeshError, ScanError
from kpred.scenes.instances import (
    INSTANCE_PROPERTIES,
    LABEL_PROPERTIES,
    column_numbers,
    instances_of_faces,
)
from kpred.shapes.captures.read import capture_scan, read_capture
from kpred.shapes.formats.ply_elements import Columns
from kpred.shapes.formats.scene_ply import plain_columns, scene_elements, vertex_columns
from kpred.shapes.formats.usd import USD_EXTENSIONS, read_usd_up
from kpred.shapes.mesh_io import read_geometry
from kpred.shapes.reading import check_file, reading
from kpred.shapes.scan import MESH_SCAN_EXTENSIONS, POINT_READERS, SCAN_EXTENSIONS

SCENE_EXTENSIONS = SCAN_EXTENSIONS
UP_AXES = ("x", "y", "z", "-x", "-y", "-z")


class SceneWarning(UserWarning):
    """Something beside a scene could not be used; the message says what and why."""


@dataclass(frozen=True, eq=False)
class Scene:
    """A scanned scene, in its own frame and units.

    Attributes:
        points: (N, 3) float64; a row may be NaN, so that labels keep their places.
        labels: (N,) NYU40 numbers; instances: (N,) numbers of objects, as the file itself carries them.
        colors: (N, 3) uint8; faces: (F, 3) rows of points.
        up: the up axis, one of x, y, z, -x, -y, -z.
        name: the scene's id, such as `scene0470_00`; path: the file.
    """

    points: np.ndarray
    labels: np.ndarray | None = None
    colors: np.ndarray | None = None
    faces: np.ndarray | None = None
    up: str = "z"
    name: str = "scene"
    path: Path | None = None
    instances: np.ndarray | None = None


def read_scene(
    path: str | os.PathLike[str], up: str | None = None, labels: str | os.PathLike[str] | None = None
) -> Scene:
    """Read a scanned scene: a PLY (ScanNet, S3DIS or any other) or another file of points or of a mesh.

    Args:
        path: the scene, or a folder of depth pictures with their poses. Of a mesh, the vertices are the points.
        up: its up axis; None means z, as in ScanNet and S3DIS, y for .glb and .gltf, and what USD and captures name.
        labels: a PLY with the same vertices and the property `label` (NYU40); None looks for ScanNet's
            `<stem>.labels.ply` beside the scene. One that is found there but does not match is left out with a
            `SceneWarning`; one that is named must match.

    Raises:
        ScanError: missing, unreadable, unknown extension, no points, or labels that do not match the points.
        ConfigError: `up` is no axis.
    """
    file = Path(path)
    extension = file.suffix.lower()
    if up is not None and up not in UP_AXES:
        raise ConfigError(f"The up axis must be one of {', '.join(UP_AXES)}, but is '{up}'.")
    if file.is_dir():
        capture = read_capture(file)
        usual_up = "z" if capture.up == "auto" else capture.up
        return Scene(capture_scan(capture).points, up=up or usual_up, name=file.resolve().name, path=file)
    check_file(file, ScanError, "scene file")
    if extension not in SCENE_EXTENSIONS:
        raise ScanError(f"{file}: unknown scene extension {extension!r}; convert it to {', '.join(SCENE_EXTENSIONS)}.")
    elements: dict[str, Columns] = {}
    faces, usual_up = None, "y" if extension in (".glb", ".gltf") else "z"
    with reading(file, ScanError):
        if extension == ".ply":
            elements = scene_elements(file)
            columns = plain_columns(elements["vertex"])
            points = np.stack([columns[axis].astype(np.float64) for axis in "xyz"], axis=1)
            faces = _faces(file, len(points)) if elements.get("face") else None
        elif extension in USD_EXTENSIONS:
            geometry, usual_up = read_usd_up(file)
            points, faces = geometry.vertices, geometry.faces if len(geometry.faces) else None
        elif extension in MESH_SCAN_EXTENSIONS:
            geometry = read_geometry(file)
            points, faces = geometry.vertices, geometry.faces if len(geometry.faces) else None
        else:
            points = np.concatenate([np.zeros((0, 3)), *POINT_READERS[extension](file)])
    vertices = elements.get("vertex", {})
    instances = column_numbers(vertices, INSTANCE_PROPERTIES)
    if not np.isfinite(points).all(axis=1).any():
        raise ScanError(f"{file}: it has no point with finite coordinates; give the scan of a scene.")
    return Scene(
        points=points,
        labels=_labels(file, len(points), vertices, None if labels is None else Path(labels)),
        colors=_colors(plain_columns(vertices)),
        faces=faces,
        up=up or usual_up,
        name=scene_name(file),
        path=file,
        instances=instances if instances is not None else instances_of_faces(elements.get("face", {}), len(points)),
    )


def scene_name(path: Path) -> str:
    """Return ScanNet's scene id of a file (`scene0470_00_vh_clean_2.labels.ply` -> `scene0470_00`)."""
    name = path.name.partition(".")[0]
    head = name.split("_")
    return "_".join(head[:2]) if len(head) > 2 and head[0].startswith("scene") and head[1].isdigit() else name


def _faces(file: Path, count: int) -> np.ndarray | None:
    try:
        geometry = read_geometry(file)
    except MeshError:  # The points are what matters; faces only make the picture finer.
        return None
    return geometry.faces if len(geometry.vertices) == count and len(geometry.faces) else None


def _colors(columns: dict[str, np.ndarray]) -> np.ndarray | None:
    for names in (("red", "green", "blue"), ("r", "g", "b"), ("diffuse_red", "diffuse_green", "diffuse_blue")):
        if all(name in columns for name in names):
            rgb = np.stack([columns[name] for name in names], axis=1)
            # Colours are 0 to 255, or 0 to 1 in files that store them as floats.
            scaled = rgb * 255.0 if rgb.dtype.kind == "f" and rgb.max(initial=0) <= 1.0 else rgb
            return np.clip(np.nan_to_num(scaled), 0, 255).astype(np.uint8)
    return None


def _labels(file: Path, count: int, columns: Columns, named: Path | None) -> np.ndarray | None:
    own = column_numbers(columns, LABEL_PROPERTIES)
    beside = file.with_name(f"{file.stem}.labels.ply")
    if named is None and (own is not None or file.suffix.lower() != ".ply" or not beside.is_file()):
        return own
    source = named or beside
    try:
        with reading(source, ScanError):
            found = column_numbers({**vertex_columns(source)}, LABEL_PROPERTIES)
        if found is None:
            raise ScanError(f"{source}: its vertices have no label property; give labels by NYU40 numbers.")
        if len(found) != count:
            raise ScanError(f"{source}: it labels {len(found)} points, but {file} has {count}; give matching labels.")
    except ScanError as error:
        if named is not None:
            raise
        warnings.warn(f"{error} The scene is used without labels.", SceneWarning, stacklevel=3)
        return None
    return found
