"""From a list of parts to one mesh on the floor, in full detail or as cuboids."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from kpred.errors import MeshError
from kpred.shapes.mesh import Mesh
from kpred.synthetic.part import Part

_CORNERS = np.array(
    [[-1, -1, -1], [1, -1, -1], [1, -1, 1], [-1, -1, 1], [-1, 1, -1], [1, 1, -1], [1, 1, 1], [-1, 1, 1]],
    dtype=np.float64,
)
_BOX_FACES = np.array(
    [
        *([0, 1, 2], [0, 2, 3], [4, 6, 5], [4, 7, 6], [0, 5, 1], [0, 4, 5]),
        *([1, 6, 2], [1, 5, 6], [2, 7, 3], [2, 6, 7], [3, 4, 0], [3, 7, 4]),
    ]
)
# A sweep is boxed in one piece up to this bend; more would turn a bent tube into a solid block.
_MAX_BEND = 40.0


def assemble(parts: Sequence[Part], name: str = "", labels: Sequence[str] | None = None) -> Mesh:
    """Join parts into one Mesh, floor at y = 0, bounding box centred in x and z.

    `face_parts` numbers each face's label by its place in `labels`, by default the sorted labels of these parts
    (`part_labels`). Raises MeshError when there is no part.
    """
    if not parts:
        raise MeshError(f"shape '{name}' has no parts; give at least one")
    names = list(part_labels(parts) if labels is None else labels)
    vertices = np.concatenate([part.vertices for part in parts])
    starts = np.cumsum([0] + [len(part.vertices) for part in parts[:-1]])
    faces = np.concatenate([part.faces + start for part, start in zip(parts, starts, strict=True)])
    numbers = np.concatenate([np.full(len(part.faces), names.index(part.label)) for part in parts])
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    middle = (low + high) / 2.0
    vertices = vertices - np.array([middle[0], low[1], middle[2]])
    return Mesh(vertices.astype(np.float32), faces.astype(np.int32), name, numbers.astype(np.int16))


def part_labels(parts: Sequence[Part]) -> tuple[str, ...]:
    """Return the distinct labels of these parts, sorted."""
    return tuple(sorted({part.label for part in parts}))


def cuboid_parts(parts: Sequence[Part]) -> list[Part]:
    """Replace every part by its box along its own axes; bent sweeps get a box per nearly straight run."""
    return [_bounding_box(points, axes, part.label) for part in parts for points, axes in _straight_runs(part)]


def cuboid_mesh(parts: Sequence[Part], name: str = "") -> Mesh:
    """Assemble the parts' cuboids (`cuboid_parts`)."""
    return assemble(cuboid_parts(parts), name)


def _bounding_box(points: np.ndarray, axes: np.ndarray, label: str) -> Part:
    local = points @ axes.T
    low, high = local.min(axis=0), local.max(axis=0)
    # A sheet without thickness would make faces without area.
    half = np.maximum((high - low) / 2.0, 1e-3)
    corners = (_CORNERS * half + (low + high) / 2.0) @ axes
    faces = _BOX_FACES if np.linalg.det(axes) > 0.0 else _BOX_FACES[:, ::-1]
    return Part(corners, faces, label, axes)


def _straight_runs(part: Part) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    if not part.ring or len(part.vertices) < 3 * part.ring:
        yield part.vertices, part.axes
        return
    rings = part.vertices.reshape(-1, part.ring, 3)
    # The first side of the section, not its middle: a wall whose upper edge slopes still has upright pieces.
    middles = rings[:, :2].mean(axis=1)
    steps = np.diff(middles, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    if lengths.min() < 1e-9:
        yield part.vertices, part.axes
        return
    steps = steps / lengths[:, None]
    first = 0
    for k in range(1, len(steps) + 1):
        straight = k < len(steps) and np.degrees(np.arccos(np.clip(steps[k] @ steps[first], -1, 1))) < _MAX_BEND
        if straight:
            continue
        if first == 0 and k == len(steps):
            yield part.vertices, part.axes
            return
        forward = middles[k] - middles[first]
        forward = forward / np.linalg.norm(forward)
        # The ring's own first side keeps a flat section flat.
        side = rings[first, 1] - rings[first, 0]
        side = side - (side @ forward) * forward
        if np.linalg.norm(side) < 1e-9:
            side = np.cross(forward, np.eye(3)[int(np.argmin(np.abs(forward)))])
        side = side / np.linalg.norm(side)
        axes = np.stack([side, np.cross(forward, side), forward])
        yield rings[first : k + 1].reshape(-1, 3), axes
        first = k
