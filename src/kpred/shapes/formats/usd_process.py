"""The polygons of a USD file, read by usd-core in a process of its own: a damaged file may end that process.

    python usd_process.py FILE OUT.npz

Run by path and not as a module: it then loads nothing of kpred. OUT holds vertices (V, 3) in the world of the file,
corners and sizes of polygons, the part of each, and what is wrong, in a sentence without the file's name.
"""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

OUTSIDE = "it refers to {what!r} outside of its folder; export it as one .usdz"
MEMORY_EXIT = 3

_MAX_GROWTH, _PER_BYTE = 700_000_000, 12
"""Bytes of memory that reading may take, and further ones for each byte of the file."""

_MAX_VALUES = 60_000_000
"""Vertices and corners of all meshes, instances included."""

_MAX_LAYERS = 4096
_AROUND = 24
"""Sides of what is round."""

Polygons = tuple[np.ndarray, np.ndarray, np.ndarray]
"""(V, 3) vertices, corners and sizes of polygons."""


def read(path: Path) -> dict[str, Any]:
    """Read the polygons of all visible meshes and solids, and all points, by their transforms to the world."""
    from pxr import Sdf, Usd, UsdGeom

    _check_layers(Sdf, path)
    stage = Usd.Stage.Open(str(path))
    if stage is None:
        raise ValueError("it is not a readable USD file (damaged or cut short); export it again")
    cache = UsdGeom.XformCache(Usd.TimeCode.Default())
    vertices, corners, sizes, parts = [np.zeros((0, 3))], [np.zeros(0, int)], [np.zeros(0, int)], [np.zeros(0, int)]
    count = values = 0
    for number, (prim, matrix) in enumerate(_placed(stage.GetPseudoRoot(), cache, Usd, UsdGeom)):
        points, indices, lengths = _polygons(prim, UsdGeom)
        values += len(points) + len(indices)
        if values > _MAX_VALUES:
            raise ValueError("its meshes and instances are too many; export fewer of them")
        vertices.append(points @ matrix[:3, :3] + matrix[3, :3])
        if np.linalg.det(matrix[:3, :3]) < 0:  # What is mirrored keeps its outside outside.
            indices = _reversed(indices, lengths)
        corners.append(indices + count)
        sizes.append(lengths)
        parts.append(np.full(len(lengths), number))
        count += len(points)
    return {
        "vertices": np.concatenate(vertices),
        "corners": np.concatenate(corners),
        "sizes": np.concatenate(sizes),
        "parts": np.concatenate(parts),
        "up": np.array(str(UsdGeom.GetStageUpAxis(stage))),
    }


def _check_layers(sdf: Any, path: Path) -> None:
    """Refuse layers outside of the folder of the file before any is composed."""
    from pxr import Ar

    folders = (path.parent.resolve(), path.resolve().parent)
    waiting, seen = [str(path)], set[str]()
    while waiting:
        name = waiting.pop()
        if name in seen or len(seen) > _MAX_LAYERS:
            continue
        seen.add(name)
        layer = sdf.Layer.FindOrOpen(name)
        for what in filter(None, layer.GetCompositionAssetDependencies() if layer is not None else ()):
            place = layer.ComputeAbsolutePath(what)
            outer = Path(Ar.SplitPackageRelativePathOuter(place)[0])
            if not any(outer.resolve().is_relative_to(folder) for folder in folders):
                raise ValueError(OUTSIDE.format(what=what[:60]))
            waiting.append(place)


def _placed(root: Any, cache: Any, usd: Any, geometry: Any) -> Iterator[tuple[Any, np.ndarray]]:
    """Yield visible prims with geometry and their (4, 4) transforms to the world, which act on rows."""
    prims = iter(usd.PrimRange(root, usd.TraverseInstanceProxies()))
    for prim in prims:
        if not prim.IsA(geometry.Imageable):
            continue
        image = geometry.Imageable(prim)
        is_hidden = image.ComputeVisibility() == geometry.Tokens.invisible
        if is_hidden or image.ComputePurpose() in (geometry.Tokens.guide, geometry.Tokens.proxy):
            if is_hidden:
                prims.PruneChildren()
            continue
        matrix = np.array(cache.GetLocalToWorldTransform(prim))
        if prim.IsA(geometry.PointInstancer):
            prims.PruneChildren()
            yield from _instances(geometry.PointInstancer(prim), matrix, cache, usd, geometry)
        elif np.isfinite(matrix).all():
            yield prim, matrix


def _instances(
    instancer: Any, matrix: np.ndarray, cache: Any, usd: Any, geometry: Any
) -> Iterator[tuple[Any, np.ndarray]]:
    """Yield the prims of all instances with their transforms; instancers within instancers are left out."""
    now = usd.TimeCode.EarliestTime()
    indices = list(instancer.GetProtoIndicesAttr().Get(now) or [])
    places = instancer.ComputeInstanceTransformsAtTime(now, now, geometry.PointInstancer.ExcludeProtoXform)
    targets = instancer.GetPrototypesRel().GetForwardedTargets()
    stage = instancer.GetPrim().GetStage()
    for row, place in zip(indices, places, strict=False):
        prototype = stage.GetPrimAtPath(targets[row]) if 0 <= row < len(targets) else None
        if not prototype:
            continue
        # The transform of a prototype's root is part of the instance.
        base = np.array(cache.GetParentToWorldTransform(prototype))
        for prim in usd.PrimRange(prototype, usd.TraverseInstanceProxies()):
            if prim.IsA(geometry.Gprim):
                local = np.array(cache.GetLocalToWorldTransform(prim)) @ np.linalg.inv(base)
                yield prim, local @ np.array(place) @ matrix


def _polygons(prim: Any, geometry: Any) -> Polygons:
    """Return vertices and polygons of a mesh, a solid or points in their own frame."""
    nothing = np.zeros((0, 3)), np.zeros(0, int), np.zeros(0, int)
    if prim.IsA(geometry.Mesh):
        mesh = geometry.Mesh(prim)
        points = np.array(_value(mesh.GetPointsAttr()), dtype=np.float64).reshape(-1, 3)
        sizes = np.array(_value(mesh.GetFaceVertexCountsAttr()), dtype=np.int64).reshape(-1)
        corners = np.array(_value(mesh.GetFaceVertexIndicesAttr()), dtype=np.int64).reshape(-1)
        if (sizes < 0).any() or sizes.sum() > len(corners):
            raise ValueError("one of its meshes has fewer corners than its faces need; export it again")
        corners = corners[: sizes.sum()]
        if len(corners) and (corners.min() < 0 or corners.max() >= len(points)):
            raise ValueError("a face names a vertex that does not exist; export it again")
        holes = np.array(_value(mesh.GetHoleIndicesAttr()), dtype=np.int64).reshape(-1)
        if len(holes):
            kept = ~np.isin(np.arange(len(sizes)), holes)
            corners, sizes = corners[np.repeat(kept, sizes)], sizes[kept]
        if mesh.GetOrientationAttr().Get() == geometry.Tokens.leftHanded:
            corners = _reversed(corners, sizes)
        return points, corners, sizes
    if prim.IsA(geometry.Points):
        points = np.array(_value(geometry.Points(prim).GetPointsAttr()), dtype=np.float64).reshape(-1, 3)
        return points, nothing[1], nothing[2]
    return _solid(prim) or nothing


def _value(attribute: Any) -> Any:
    """Return the value at rest, or the first one of an animation."""
    value = attribute.Get()
    if value is None and attribute.GetNumTimeSamples():
        value = attribute.Get(attribute.GetTimeSamples()[0])
    return [] if value is None else value


def _solid(prim: Any) -> Polygons | None:
    """Return the polygons of a box, sphere, cylinder, cone or capsule."""

    def number(name: str) -> float:
        return float(prim.GetAttribute(name).Get())

    kind = str(prim.GetTypeName())
    if kind == "Cube":
        points = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * number("size") / 2
        faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
        return points, np.array(faces).reshape(-1), np.full(6, 4)
    half = np.linspace(-np.pi / 2, np.pi / 2, _AROUND // 2 + 1)
    arc = np.stack([np.cos(half), np.sin(half)], axis=1)
    if kind == "Sphere":
        return _turned(arc * number("radius"), "Z")
    if kind not in ("Cylinder", "Cone", "Capsule"):
        return None
    radius, end, axis = number("radius"), number("height") / 2, str(prim.GetAttribute("axis").Get())
    if kind == "Capsule":
        low, high = arc[half <= 1e-9], arc[half >= -1e-9]
        return _turned(np.concatenate([low * radius - [0, end], high * radius + [0, end]]), axis)
    top = radius if kind == "Cylinder" else 0.0
    return _turned(np.array([[0, -end], [radius, -end], [top, end], [0, end]]), axis)


def _turned(profile: np.ndarray, axis: str) -> Polygons:
    """Turn a profile (n, 2) of distances from an axis and places along it around that axis."""
    angles = np.arange(_AROUND) * 2 * np.pi / _AROUND
    around = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    points = np.concatenate(
        [profile[:, None, :1] * around, np.repeat(profile[:, None, 1:], _AROUND, axis=1)], axis=2
    ).reshape(-1, 3)
    steps = np.arange(len(profile) - 1)[:, None] * _AROUND
    here, there = steps + np.arange(_AROUND), steps + (np.arange(_AROUND) + 1) % _AROUND
    faces = np.stack([here, there, there + _AROUND, here + _AROUND], axis=2).reshape(-1, 4)
    turns = {"X": [2, 0, 1], "Y": [1, 2, 0], "Z": [0, 1, 2]}
    return points[:, turns.get(axis, [0, 1, 2])], faces.reshape(-1), np.full(len(faces), 4)


def _reversed(corners: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """Reverse the corners of every polygon."""
    ends = np.cumsum(sizes)
    within = np.arange(len(corners)) - np.repeat(ends - sizes, sizes)
    reversed_corners: np.ndarray = corners[np.repeat(ends, sizes) - 1 - within]
    return reversed_corners


def _watch_memory(limit: int) -> None:
    """End this process when it takes more memory than that; where the system does not say how much, do nothing."""
    try:
        page = os.sysconf("SC_PAGE_SIZE")
        while True:
            with open("/proc/self/statm", encoding="ascii") as stream:
                if int(stream.read().split()[1]) * page > limit:
                    os._exit(MEMORY_EXIT)
            time.sleep(0.02)
    except (OSError, ValueError, AttributeError):
        return


def main() -> int:
    """Read one file, write what it holds or what is wrong."""
    path, out = Path(sys.argv[1]), sys.argv[2]
    limit = _MAX_GROWTH + _PER_BYTE * path.stat().st_size
    threading.Thread(target=_watch_memory, args=(limit,), daemon=True).start()
    try:
        found = read(path)
    except Exception as error:  # pxr raises its own kinds, with the file's bytes in their text.
        is_own = type(error) is ValueError
        found = {"problem": np.array(str(error) if is_own else "it is damaged or cut short; export it again")}
    np.savez(out, **found)
    return 0


if __name__ == "__main__":
    sys.exit(main())
