"""Which points of a scene lie in a box: boxes given by hand, and those of annotated CAD models."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from kpred.errors import MeshError
from kpred.scenes.scan2cad import AlignedModel, model_path
from kpred.scenes.scene import Scene
from kpred.shapes.categories import NYU40, STRUCTURE, nyu40_numbers
from kpred.shapes.mesh_io import read_mesh

REACH = 1.25
"""Annotated models are the nearest in ShapeNet, not the same product: their boxes are taken this much larger."""


_CENTERS = ("center", "centroid", "centre", "position", "location")
_SIZES = ("size", "dimensions", "extent", "extents", "lengths")
_LABELS = ("category", "label", "class", "classname", "class_name", "type")


def box_members(points: np.ndarray, up: str, box: Mapping[str, Any]) -> np.ndarray | str:
    """Return the mask (N,) of points (N, 3) in a box, or the reason why the box is invalid.

    A box is `center` (3,), `size` (3,), full lengths along x, y and z before it is turned, and `yaw`, radians about the
    up axis (0 when left out), or instead of it `axes`, (3, 3) with the directions of its sides in rows; or `corners`,
    two opposite ones as (2, 3) or (3, 2), or all eight; or `min` and `max`. It stands in the scene's frame and units.
    """
    try:
        center, size, yaw, axes = _of_box(box)
    except (KeyError, TypeError, ValueError, OverflowError):
        return "it is neither center, size and yaw nor corners"
    if center.shape != (3,) or size.shape != (3,):
        return "its center and size are not three numbers each"
    if not (np.isfinite(center).all() and np.isfinite(size).all() and np.isfinite(yaw)):
        return "it holds NaN or infinite numbers"
    if (size <= 0).any():
        return f"its size {size.tolist()} is not positive"
    if axes is not None and not np.allclose(axes @ axes.T, np.eye(3), atol=1e-2):
        return "its axes are not three directions at right angles"
    with np.errstate(over="ignore", invalid="ignore"):
        local = (points - center) @ (_yaw_rotation(up, yaw) if axes is None else axes.T)
    inside: np.ndarray = (np.abs(local) <= size / 2 + 1e-9).all(axis=1)
    return inside


def box_label(box: Mapping[str, Any]) -> str | None:
    """Return what a box says that it holds, under any of several keys."""
    for key in _LABELS:
        value = box.get(key)
        # RoomPlan writes {"chair": {}}.
        value = next(iter(value), None) if isinstance(value, dict) else value
        if isinstance(value, str) and value.strip():
            return value
    return None


def _of_box(box: Mapping[str, Any]) -> tuple[np.ndarray, np.ndarray, float, np.ndarray | None]:
    """Return center (3,), size (3,), yaw and axes (3, 3), one of them per row, where the box names them.

    Raises:
        KeyError, TypeError, ValueError: something is missing or no number.
    """
    if "transform" in box and "dimensions" in box:  # RoomPlan: a matrix column by column
        matrix = np.asarray(box["transform"], dtype=np.float64).reshape(4, 4)
        return matrix[3, :3], np.asarray(box["dimensions"], dtype=np.float64), 0.0, matrix[:3, :3]
    center, size = _first(box, _CENTERS), _first(box, _SIZES)
    if center is None or (size is None and "coeffs" not in box):
        corners = np.asarray(box["corners"] if "corners" in box else [box["min"], box["max"]], dtype=np.float64)
        if corners.shape == (8, 3):
            return _of_corners(corners)
        corners = corners.T if corners.shape == (3, 2) else corners
        if corners.shape != (2, 3):
            raise ValueError("neither two corners nor eight")
        return corners.mean(axis=0), np.abs(corners[1] - corners[0]), 0.0, None
    # SUN RGB-D writes half lengths.
    sides = np.asarray(size, dtype=np.float64) if size is not None else 2 * np.asarray(box["coeffs"], dtype=np.float64)
    axes = _first(box, ("axes", "basis"))
    columns = _first(box, ("R", "rotation_matrix"))  # Open3D: an axis per column
    rows = None if axes is None else np.asarray(axes, dtype=np.float64).reshape(3, 3)
    rows = rows if columns is None else np.asarray(columns, dtype=np.float64).reshape(3, 3).T
    yaw = _first(box, ("yaw", "heading", "heading_angle"))
    return np.asarray(center, dtype=np.float64), sides, float(yaw or 0.0), rows


def _first(box: Mapping[str, Any], keys: Sequence[str]) -> Any:
    return next((box[key] for key in keys if box.get(key) is not None), None)


def _of_corners(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray, float, np.ndarray]:
    """Find center, size and axes of the box with these eight corners (8, 3), in any order.

    Raises:
        ValueError: they are not those of a box.
    """
    sides = corners[1:] - corners[0]
    scale = float(np.abs(sides).max())
    for triple in itertools.combinations(range(7), 3):
        edges = sides[list(triple)]
        lengths = np.linalg.norm(edges, axis=1)
        is_square = np.abs(edges @ edges.T - np.diag(lengths**2)).max() <= 1e-2 * scale**2
        is_whole = np.linalg.norm(sides - edges.sum(axis=0), axis=1).min() <= 1e-2 * scale
        if is_square and is_whole and lengths.min() > 0:
            return corners.mean(axis=0), lengths, 0.0, edges / lengths[:, None]
    raise ValueError("not the corners of a box")


def arkit_boxes(entries: Sequence[Any]) -> list[dict[str, Any]]:
    """Convert the `data` of an ARKitScenes annotation to boxes; broken ones have no center."""
    boxes = []
    for entry in entries:
        item = entry if isinstance(entry, dict) else {}
        held = item.get("segments")
        segments: dict[str, Any] = held if isinstance(held, dict) else {}
        found_box = next((segments[key] for key in ("obbAligned", "obb") if isinstance(segments.get(key), dict)), None)
        box: dict[str, Any] = found_box or {}
        found = {"center": box.get("centroid"), "size": box.get("axesLengths"), "axes": box.get("normalizedAxes")}
        boxes.append({"label": item.get("label"), **{key: value for key, value in found.items() if value is not None}})
    return boxes


def labelcloud_box(item: Mapping[str, Any]) -> dict[str, Any] | None:
    """Convert an object of labelCloud (z up, degrees) to a box; None if it is none."""
    parts = [item.get(key) for key in ("centroid", "dimensions", "rotations")]
    if not all(isinstance(part, dict) for part in parts):
        return None
    (centroid, sides, rotations) = (part for part in parts if isinstance(part, dict))
    try:
        angles = [float(rotations[axis]) for axis in "xyz"]
        rotation = Rotation.from_euler("XYZ", angles, degrees=True).as_matrix()
    except (KeyError, TypeError, ValueError, OverflowError):
        return {"label": item.get("name")}
    size = [sides.get(key) for key in ("length", "width", "height")]
    return {
        "label": item.get("name"),
        "center": [centroid.get(axis) for axis in "xyz"],
        "size": size,
        "axes": rotation.T,
    }


def annotated_members(scene: Scene, models: Sequence[AlignedModel]) -> list[np.ndarray | str]:
    """Return, for each model, the mask (N,) of its points, or the reason why there is none.

    A point belongs to the model in whose box it lies deepest, among those whose class it has; without labels, to the
    deepest of all, within the model's own box. Walls, floors and ceilings belong to none.
    """
    result: list[np.ndarray | str] = []
    depths = []
    for model in models:
        box = _own_box(scene, model)
        if isinstance(box, str):
            result.append(box)
            depths.append(np.full(len(scene.points), np.inf))
            continue
        result.append("")
        half_size, center = box
        inverse = np.linalg.inv(model.cad_to_scan)
        local = scene.points @ inverse[:3, :3].T + inverse[:3, 3]
        # Flat models have no thickness to divide by.
        depth = (np.abs(local - center) / np.maximum(half_size, 0.02 * half_size.max())).max(axis=1)
        depths.append(np.where(np.isnan(depth) | ~_of_class(scene, model.category), np.inf, depth))
    if not depths:
        return result
    stacked = np.stack(depths)
    owner = stacked.argmin(axis=0)
    reached = stacked.min(axis=0) <= (REACH if scene.labels is not None else 1.0)
    return [text if text else reached & (owner == number) for number, text in enumerate(result)]


def _of_class(scene: Scene, category: str) -> np.ndarray:
    if scene.labels is None:
        return np.ones(len(scene.points), dtype=bool)
    numbers = nyu40_numbers(category)
    if numbers:
        return np.isin(scene.labels, numbers)
    return ~np.isin(scene.labels, [NYU40.index(name) for name in STRUCTURE])


def _own_box(scene: Scene, model: AlignedModel) -> tuple[np.ndarray, np.ndarray] | str:
    """Return half size and centre of a model's box in its own frame: as annotated, else of its mesh."""
    if model.half_size is not None and model.center is not None:
        return model.half_size, model.center
    # Scan2CAD's repository: Assets/scannet-sample/<scene>/<file> and Assets/shapenet-sample/<synset>/<model>.
    roots = [] if scene.path is None else [parent / "shapenet-sample" for parent in scene.path.resolve().parents[:3]]
    for root in roots:
        try:
            bounds = read_mesh(model_path(model, root)).bounds.astype(np.float64)
        except MeshError:
            continue
        return (bounds[1] - bounds[0]) / 2, bounds.mean(axis=0)
    return (
        f"{model.name}: it has no bbox and center, and its CAD model "
        f"{Path(model.catid_cad) / model.id_cad} is missing; add either."
    )


def _yaw_rotation(up: str, yaw: float) -> np.ndarray:
    """Return the rotation (3, 3) that takes rows of points into a box of `yaw` about the up axis."""
    axis = "xyz".index(up[-1])
    first, second = (axis + 1) % 3, (axis + 2) % 3
    angle = -yaw if up.startswith("-") else yaw
    rotation = np.eye(3)
    rotation[first, first] = rotation[second, second] = np.cos(angle)
    rotation[first, second], rotation[second, first] = -np.sin(angle), np.sin(angle)
    return rotation
