"""An OBJ file put into metres, y up, front +z, on the floor: its coordinates change, every other byte stays."""

from __future__ import annotations

import numpy as np

from kpred.errors import MeshError
from kpred.ops.typing import Bool, Float


def place_obj(
    data: bytes, rotation: Float[np.ndarray, "3 3"], size: Float[np.ndarray, "3"], name: str
) -> tuple[bytes, list[str]]:
    """Rotate and scale an OBJ to a box of `size` (width, height, depth), centred on the floor.

    Lines of `v` and `vn` are written anew; an axis along which the model has no extent is scaled as the others are.

    Returns:
        The file, and the material libraries it names.

    Raises:
        MeshError: a vertex or face is damaged, or there is none.
    """
    lines = data.replace(b"\r\n", b"\n").split(b"\n")
    vertex_rows = [row for row, line in enumerate(lines) if line.startswith(b"v ")]
    normal_rows = [row for row, line in enumerate(lines) if line.startswith(b"vn ")]
    vertices, normals = _numbers(lines, vertex_rows, name), _numbers(lines, normal_rows, name)
    if not len(vertices):
        raise MeshError(f"{name}: it has no vertices; leave it out.")
    turned = vertices @ rotation.T
    seen = turned[_used(lines, len(vertices), name)]
    low, high = seen.min(axis=0), seen.max(axis=0)
    extent = high - low
    solid = extent > 0
    if not solid.any():
        raise MeshError(f"{name}: all its vertices are at one place; leave it out.")
    scale = np.full(3, float((size[solid] / extent[solid]).mean()))
    scale[solid] = size[solid] / extent[solid]
    anchor = np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
    placed = (turned - anchor) * scale
    moved = normals @ rotation.T / scale
    moved /= np.maximum(np.linalg.norm(moved, axis=1, keepdims=True), np.finfo(float).tiny)
    for row, (x, y, z) in zip(vertex_rows, placed.tolist(), strict=True):
        lines[row] = b"v %.7g %.7g %.7g" % (x, y, z)
    for row, (x, y, z) in zip(normal_rows, moved.tolist(), strict=True):
        lines[row] = b"vn %.5g %.5g %.5g" % (x, y, z)
    libraries = [line[7:].strip().decode("utf-8", "replace") for line in lines if line.startswith(b"mtllib ")]
    return b"\n".join(lines), libraries


def _used(lines: list[bytes], count: int, name: str) -> Bool[np.ndarray, " vertices"]:
    """Mark the vertices that faces use; only they have a place in the box."""
    used = np.zeros(count, dtype=bool)
    seen = 0
    for line in lines:
        if line.startswith(b"v "):
            seen += 1
        elif line.startswith(b"f "):
            try:
                numbers = [int(word.split(b"/", 1)[0]) for word in line.split()[1:]]
                used[[number - 1 if number > 0 else seen + number for number in numbers]] = True
            except (ValueError, IndexError) as error:
                raise MeshError(f"{name}: one of its faces is damaged; leave it out.") from error
    if not used.any():
        raise MeshError(f"{name}: it has no faces; leave it out.")
    return used


def _numbers(lines: list[bytes], rows: list[int], name: str) -> Float[np.ndarray, "rows 3"]:
    try:
        values = np.array([lines[row].split()[1:4] for row in rows], dtype=np.float64).reshape(-1, 3)
    except ValueError as error:
        raise MeshError(f"{name}: one of its coordinates is damaged; leave it out.") from error
    if not np.isfinite(values).all():
        raise MeshError(f"{name}: one of its coordinates is not finite; leave it out.")
    return values
