"""Reading a scan: any common file of points or of a scanned mesh becomes an array of points."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import numpy as np

from kpred.errors import ConfigError, ScanError
from kpred.ops.typing import Float
from kpred.shapes.formats.ply_header import read_ply_header
from kpred.shapes.formats.records import BLOCK_ROWS
from kpred.shapes.formats.scan_array import npy_points, npz_points
from kpred.shapes.formats.scan_e57 import e57_points
from kpred.shapes.formats.scan_las import las_points
from kpred.shapes.formats.scan_laz import laz_points
from kpred.shapes.formats.scan_pcd import pcd_points
from kpred.shapes.formats.scan_ply import ply_points
from kpred.shapes.formats.scan_ptx import ptx_points
from kpred.shapes.formats.scan_text import text_points
from kpred.shapes.formats.usd import USD_EXTENSIONS
from kpred.shapes.mesh_io import Geometry, read_geometry
from kpred.shapes.precision import single_precision_step
from kpred.shapes.reading import check_file, reading

TEXT_EXTENSIONS = (".xyz", ".xyzn", ".xyzrgb", ".txt", ".csv", ".tsv", ".asc", ".dat", ".pts")
MESH_SCAN_EXTENSIONS = (".obj", ".stl", ".off", ".glb", ".gltf", *USD_EXTENSIONS)
POINT_EXTENSIONS = (".ply", ".pcd", *TEXT_EXTENSIONS, ".ptx", ".las", ".laz", ".e57", ".npy", ".npz")
SCAN_EXTENSIONS = (*POINT_EXTENSIONS, *MESH_SCAN_EXTENSIONS)

MINIMUM_POINTS = 64
SURFACE_SAMPLES = 32768

# A mesh is dense when its own vertices describe it: at least this many, and this fraction of the area in faces whose
# longest edge is at most this part of the box's diagonal. Beyond the last number faces are not even read.
_DENSE_VERTICES = 2048
_DENSE_AREA = 0.9
_DENSE_EDGE = 0.05
_ALWAYS_DENSE = 1_000_000

# Coordinates whose steps in single precision are larger than this part of the object spoil its surface.
_COARSE_STEP = 0.01

# Sizes whose squares single precision cannot hold; no unit of length makes an object so small or so large.
_MIN_EXTENT, _MAX_EXTENT = 1e-18, 1e18

# Width over length (as standard deviations) below which points count as lying on one line.
_LINE = 1e-4

# Points that are so many median distances from the middle say nothing about that.
_FAR = 100.0


POINT_READERS: dict[str, Callable[[Path], Iterator[np.ndarray]]] = {
    ".pcd": pcd_points,
    ".ptx": ptx_points,
    ".las": las_points,
    ".laz": laz_points,
    ".e57": e57_points,
    ".npy": npy_points,
    ".npz": npz_points,
    **dict.fromkeys(TEXT_EXTENSIONS, text_points),
}
"""Readers of files that hold points alone."""


class ScanWarning(UserWarning):
    """A scan can be used, but may be worse than it should be; the message says why."""


def read_scan(path: str | os.PathLike[str], max_points: int = 200_000, seed: int = 0) -> Float[np.ndarray, "points 3"]:
    """Read the points of a scan, in the file's own frame and unit.

    Points come from .ply, .pcd, .xyz, .txt, .csv (and other text), .pts, .ptx, .las, .laz, .e57, .npy and .npz;
    columns other than x, y, z are ignored. A file with faces (.ply, .obj, .stl, .off, .glb, .gltf, .usd, .usdz) gives
    its vertices when it is a dense scan mesh, as scanners and depth fusion make them; when it has large faces, as CAD
    models and decimated scans do, points are drawn evenly from its surface by ``seed``. Memory is bounded by
    ``max_points`` for files of points other than ``binary_compressed`` PCD, however many the file holds.

    Raises:
        ScanError: missing, unreadable, cut short, unknown extension, or points that ``check_points`` refuses.
        ConfigError: ``max_points`` is below 64.
    """
    file = Path(path)
    if max_points < MINIMUM_POINTS:
        raise ConfigError(f"max_points is {max_points}; it must be at least {MINIMUM_POINTS}.")
    extension = file.suffix.lower()
    check_file(file, ScanError, "scan file")
    if extension not in SCAN_EXTENSIONS:
        raise ScanError(f"{file}: unknown scan extension {extension!r}; convert it to {', '.join(SCAN_EXTENSIONS)}.")
    with reading(file, ScanError):
        points = _sampled(_blocks(file, extension, max_points, seed), max_points, seed, str(file))
        found = check_points(points, str(file))
    _report_coarse_steps(found, str(file))
    return found


def check_points(points: np.ndarray, name: str = "scan") -> Float[np.ndarray, "points 3"]:
    """Drop points with NaN or infinite coordinates and check that the others can be an object.

    Points in one plane are allowed, points on one line are not.

    Args:
        points: (N, 3) numbers.
        name: what messages call it, usually the file.

    Returns:
        (M, 3) float64.

    Raises:
        ScanError: wrong shape, fewer than 64 distinct finite points, or all on one line.
    """
    array = np.asarray(points, dtype=np.float64)
    if array.ndim != 2 or array.shape[1] != 3:
        raise ScanError(f"{name}: points must have shape (N, 3), not {array.shape}; give x, y, z rows.")
    finite = np.isfinite(array).all(axis=1)
    _report_invalid(int(finite.sum()), len(array), name)
    array = array if finite.all() else array[finite]
    # Most scans pass on their first points; only suspicious ones need all of them compared.
    for some in (array[: 2 * MINIMUM_POINTS], array[:4096], array):
        distinct = len(np.unique(some, axis=0))
        if distinct >= MINIMUM_POINTS:
            break
    else:
        raise ScanError(
            f"{name}: it has {distinct} distinct points; give a scan with at least {MINIMUM_POINTS} points."
        )
    low, high = array.min(axis=0), array.max(axis=0)
    with np.errstate(over="ignore"):
        extent = float((high - low).max())
        if not _MIN_EXTENT < extent < _MAX_EXTENT:
            size = "large" if extent > 1 else "small"
            raise ScanError(f"{name}: its coordinates are too {size} to be a scan; check its unit.")
    centred = (array - (low / 2 + high / 2)) / extent
    # One point very far away makes a line of any cloud.
    distance = np.linalg.norm(centred - np.median(centred, axis=0), axis=1)
    apart = distance[distance > 0]
    near = centred[distance <= _FAR * float(np.median(apart))] if len(apart) else centred
    spread = np.sqrt(np.maximum(np.linalg.eigvalsh(np.cov(near.T)), 0.0))
    if spread[1] <= _LINE * spread[2]:
        raise ScanError(f"{name}: all its points lie on one line; give the scan of a whole object.")
    return array


def _report_invalid(finite: int, total: int, name: str) -> None:
    """Refuse a scan with too few finite points; warn when more than half are not finite."""
    if finite == total:
        return
    if finite < MINIMUM_POINTS:
        raise ScanError(
            f"{name}: {total - finite} of {total} points are NaN or infinite; save the scan without invalid points."
        )
    if 2 * finite <= total:
        warnings.warn(
            f"{name}: {total - finite} of {total} points are NaN or infinite and were left out.", ScanWarning, 3
        )


def _report_coarse_steps(points: np.ndarray, name: str) -> None:
    """Warn of points that were stored in single precision far from the origin, where its steps are large."""
    step = single_precision_step(points)
    extent = float((points.max(axis=0) - points.min(axis=0)).max())
    if step > _COARSE_STEP * extent and np.array_equal(points, points.astype(np.float32)):
        warnings.warn(
            f"{name}: its points are stored in single precision, {step:.2g} apart at this distance from the origin, "
            f"but the scan is {extent:.2g} large; export it nearer to its origin, or in double precision.",
            ScanWarning,
            3,
        )


def _blocks(file: Path, extension: str, max_points: int, seed: int) -> Iterable[np.ndarray]:
    if extension == ".ply":
        header = read_ply_header(file)
        if header.count("face", "tristrips") and header.count("vertex") <= _ALWAYS_DENSE:
            return _mesh_blocks(read_geometry(file), str(file), max_points, seed)
        return ply_points(file, header)
    if extension in POINT_READERS:
        return POINT_READERS[extension](file)
    return _mesh_blocks(read_geometry(file), str(file), max_points, seed)


def _sampled(blocks: Iterable[np.ndarray], count: int, seed: int, name: str) -> np.ndarray:
    """Sample at most ``count`` finite points of all blocks uniformly, in their order.

    Every point draws a random key and those with the smallest keys stay: one pass, and never more than about three
    times ``count`` points in memory.
    """
    generator = np.random.default_rng(seed)
    kept: list[np.ndarray] = [np.zeros((0, 3))]
    keys: list[np.ndarray] = [np.zeros(0)]
    held = total = finite = 0
    highest = np.inf
    for block in blocks:
        total += len(block)
        good = np.isfinite(block).all(axis=1)
        block = block if good.all() else block[good]
        finite += len(block)
        key = generator.random(len(block))
        if highest < np.inf:
            chosen = key < highest
            block, key = block[chosen], key[chosen]
        kept.append(block)
        keys.append(key)
        held += len(block)
        if held > count + max(count, BLOCK_ROWS):
            points, key = _smallest(np.concatenate(kept), np.concatenate(keys), count)
            kept, keys, held, highest = [points], [key], count, float(key.max())
    _report_invalid(finite, total, name)
    return _smallest(np.concatenate(kept), np.concatenate(keys), count)[0]


def _smallest(points: np.ndarray, keys: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    if len(points) <= count:
        return points, keys
    chosen = np.sort(np.argpartition(keys, count - 1)[:count])
    return points[chosen], keys[chosen]


def _mesh_blocks(geometry: Geometry, name: str, max_points: int, seed: int) -> Iterator[np.ndarray]:
    vertices, faces = geometry.vertices, geometry.faces
    good = np.isfinite(vertices).all(axis=1)
    faces = faces[good[faces].all(axis=1)]
    if len(faces):
        corners = vertices[faces] - vertices[faces[0, 0]]
        edges = np.roll(corners, -1, axis=1) - corners
        with np.errstate(over="ignore", invalid="ignore"):
            areas = 0.5 * np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
            longest = np.sqrt((edges**2).sum(axis=2).max(axis=1))
            box = corners.reshape(-1, 3)
            diagonal = float(np.linalg.norm(box.max(axis=0) - box.min(axis=0)))
        if 0 < areas.sum() < np.inf and not _is_dense(len(np.unique(faces)), areas, longest, diagonal):
            _report_coarse_steps(vertices[good], name)
            yield _surface_samples(vertices, faces, areas, min(max_points, SURFACE_SAMPLES), seed)
            return
    for start in range(0, len(vertices), BLOCK_ROWS):
        yield vertices[start : start + BLOCK_ROWS]


def _is_dense(vertices: int, areas: np.ndarray, longest: np.ndarray, diagonal: float) -> bool:
    small = longest <= _DENSE_EDGE * diagonal
    return vertices >= _DENSE_VERTICES and float(areas[small].sum()) >= _DENSE_AREA * float(areas.sum())


def _surface_samples(vertices: np.ndarray, faces: np.ndarray, areas: np.ndarray, count: int, seed: int) -> np.ndarray:
    """Sample points (count, 3) float64, uniform by area over the surface."""
    generator = np.random.default_rng([seed, 1])
    cumulative = np.cumsum(areas)
    drawn = np.searchsorted(cumulative, generator.random(count) * cumulative[-1], side="right")
    # Rounding may reach the very end; a face of zero area is never the answer of "right" before it.
    drawn = np.minimum(drawn, int(np.flatnonzero(areas).max()))
    u, v = generator.random((2, count, 1))
    outside = u + v > 1
    u, v = np.where(outside, 1 - u, u), np.where(outside, 1 - v, v)
    a, b, c = (vertices[faces[drawn, corner]] for corner in range(3))
    samples: np.ndarray = a + u * (b - a) + v * (c - a)
    return samples
