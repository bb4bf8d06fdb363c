"""A model's structure as arrays of the database, and back: small integers, float32, checked on the way in and out."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from kpred.database.arrays import DamagedArray, pack_array
from kpred.ops.typing import Float, Int
from kpred.shapes.structure import Structure

PREFIX = "structure."
"""Start of the names of these arrays."""

_FLOATS = ("axes", "boxes", "contact_points", "affine_ranges")
_INTEGERS = {"contact_parts": "<u1", "mirrored_parts": "<i2", "curved": "<u1", "ends_only": "<u1"}
FITTING_STRUCTURE = tuple(PREFIX + name for name in (*_FLOATS, *_INTEGERS, "mirror"))
"""Arrays that fitting reads: all but those of vertices and faces."""

NORMAL_STEP = 1.0 / 127.0
"""Coordinates of point normals are stored as multiples of this."""

MAX_PARTS = 255
"""Parts of one model: the number of a part is stored in a byte."""

MAX_COORDINATE = 8.0
"""Largest coordinate, unit box: own axes and boxes around oblique parts reach somewhat beyond 1."""

_MAX_NORMAL = 1.001
"""Largest coordinate of a unit normal, after rounding."""

_NOT_SQUARE = 1e-3
"""Largest error of the products of a part's own directions."""


def rounded_structure(structure: Structure) -> Structure:
    """Round a structure to what is stored: numbers of float32 (as float64), int32, bool."""
    return Structure(
        vertex_parts=np.asarray(structure.vertex_parts, np.int32),
        facets=np.asarray(structure.facets, np.int32),
        axes=_rounded(structure.axes),
        boxes=_rounded(structure.boxes),
        curved=np.asarray(structure.curved, bool),
        contact_parts=np.asarray(structure.contact_parts, np.int32),
        contact_points=_rounded(structure.contact_points),
        mirror=float(np.float32(structure.mirror)),
        mirrored_parts=np.asarray(structure.mirrored_parts, np.int32),
        affine_ranges=_rounded(structure.affine_ranges),
        ends_only=np.asarray(structure.ends_only, bool),
    )


def check_structure(structure: Structure, vertices: int, faces: int) -> None:
    """Refuse a structure that is not one of a mesh of so many vertices and faces, in the unit box.

    Raises:
        DamagedArray: shapes disagree, a number is not finite or out of range; it names the array.
    """
    _check_shapes(vars(structure), vertices, faces)
    parts = structure.parts
    limits = {"vertex_parts": (0, parts), "facets": (-1, faces), "contact_parts": (0, parts)}
    for name, (low, high) in (limits | {"mirrored_parts": (-1, parts)}).items():
        numbers = getattr(structure, name)
        inside = not numbers.size or (numbers.min() >= low and numbers.max() < high)
        _require(bool(inside), name, f"holds numbers outside {low} to {high - 1}")
    _check_numbers(structure)


def _check_shapes(arrays: Mapping[str, np.ndarray], vertices: int, faces: int) -> None:
    parts, contacts = len(arrays["curved"]), len(arrays["contact_parts"])
    _require(1 <= parts <= MAX_PARTS, "curved", f"is of {parts} parts, 1 to {MAX_PARTS} are wanted")
    shapes = {
        "vertex_parts": (vertices,),
        "facets": (faces,),
        "axes": (parts, 3, 3),
        "boxes": (parts, 2, 3),
        "curved": (parts,),
        "contact_parts": (contacts, 2),
        "contact_points": (contacts, 3),
        "mirrored_parts": (parts,),
        "ends_only": (parts, 3),
        "affine_ranges": (len(arrays["affine_ranges"]), 4),
    }
    for name, shape in shapes.items():
        found = np.shape(arrays[name])
        _require(found == shape, name, f"has shape {found}, {shape} is wanted")
    _require(contacts % 2 == 0, "contact_points", "has an odd number of rows, two a contact are wanted")


def _check_numbers(structure: Structure) -> None:
    ranges = structure.affine_ranges
    measures = {name: getattr(structure, name) for name in _FLOATS} | {"affine_ranges": ranges[:, 2:]}
    for name, numbers in measures.items():
        # NaN is not below the limit either.
        inside = bool((np.abs(numbers) <= MAX_COORDINATE).all())
        _require(inside, name, f"holds NaN or coordinates beyond {MAX_COORDINATE:g}")
    _require(not abs(structure.mirror) > MAX_COORDINATE, "mirror", f"is beyond {MAX_COORDINATE:g}")
    products = structure.axes @ structure.axes.transpose(0, 2, 1)
    square = bool((np.abs(products - np.eye(3)) <= _NOT_SQUARE).all())
    _require(square, "axes", "holds directions that are not at right angles")
    ordered = bool((structure.boxes[:, 0] <= structure.boxes[:, 1]).all())
    _require(ordered, "boxes", "holds lowest coordinates above the highest")
    parts_and_axes = ranges[:, :2]
    whole = parts_and_axes == np.floor(parts_and_axes)
    existing = (parts_and_axes >= 0) & (parts_and_axes < (len(structure.curved), 3))
    _require(bool((whole & existing).all()), "affine_ranges", "names parts or axes that do not exist")
    _require(bool((ranges[:, 2] <= ranges[:, 3]).all()), "affine_ranges", "holds starts above their ends")


def check_point_structure(point_parts: np.ndarray, point_normals: np.ndarray, points: int, parts: int) -> None:
    """Refuse parts and normals that are not those of so many points on a mesh of so many parts.

    Raises:
        DamagedArray: shapes disagree, a number is not finite or out of range; it names the array.
    """
    shapes = np.shape(point_parts), np.shape(point_normals)
    if shapes != ((points,), (points, 3)):
        raise DamagedArray(f"point_parts and point_normals have shapes {shapes}, {points} points are there")
    if points and not (point_parts.min() >= 0 and point_parts.max() < parts):
        raise DamagedArray(f"point_parts holds numbers outside 0 to {parts - 1}")
    if not (np.abs(point_normals) <= _MAX_NORMAL).all():
        raise DamagedArray("point_normals holds numbers that are no coordinates of unit normals")


def pack_structure(
    structure: Structure, point_parts: Int[np.ndarray, " points"], point_normals: Float[np.ndarray, "points 3"]
) -> dict[str, dict[str, Any]]:
    """Pack a structure, and the parts and normals of its points, into name -> columns; see `pack_array`."""
    facets = "<i2" if len(structure.facets) <= np.iinfo(np.int16).max else "<i4"
    kinds = {name: "<f4" for name in _FLOATS} | _INTEGERS | {"vertex_parts": "<u1", "facets": facets}
    return {
        **{PREFIX + name: pack_array(getattr(structure, name), kind) for name, kind in kinds.items()},
        PREFIX + "mirror": pack_array(np.array([structure.mirror]), "<f4"),
        "point_parts": pack_array(point_parts, "<u1"),
        "point_normals": pack_array(point_normals, "<i1", NORMAL_STEP),
    }


def unpack_structure(arrays: Mapping[str, np.ndarray], vertices: int = 0, faces: int = 0) -> Structure:
    """Make the structure of a mesh of so many vertices and faces; 0 where their arrays were not read.

    Raises:
        DamagedArray: an array is missing, or not one of such a structure; it names the array.
    """
    missing = [name for name in FITTING_STRUCTURE if name not in arrays]
    if missing:
        raise DamagedArray(f"{missing[0]} is missing")
    nothing = np.zeros(0, np.int32)
    values: dict[str, Any] = {name: np.asarray(arrays[PREFIX + name], np.float64) for name in _FLOATS}
    for name in ("contact_parts", "mirrored_parts"):
        values[name] = np.asarray(arrays[PREFIX + name], np.int32)
    for name in ("vertex_parts", "facets"):
        values[name] = np.asarray(arrays.get(PREFIX + name, nothing), np.int32)
    values |= {name: arrays[PREFIX + name] != 0 for name in ("curved", "ends_only")}
    mirror = arrays[PREFIX + "mirror"]
    _require(mirror.shape == (1,), "mirror", f"has shape {mirror.shape}, (1,) is wanted")
    _check_shapes(values, vertices, faces)
    found = Structure(mirror=float(mirror[0]), **values)
    check_structure(found, vertices, faces)
    return found


def _rounded(numbers: np.ndarray) -> np.ndarray:
    return np.asarray(numbers, np.float32).astype(np.float64)


def _require(holds: bool, name: str, sentence: str) -> None:
    if not holds:
        raise DamagedArray(f"{PREFIX}{name} {sentence}")
