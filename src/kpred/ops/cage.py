"""Cages: a 42-vertex icosphere around the shape, pulled in toward it; one depends on the source shape alone.

`pulled_in_cage` is the scheme of the published method, which may cut through the shape. `enclosing_cage` follows it as
far as the shape allows and encloses every given point by construction, so that mean value coordinates stay positive
where the cage is convex and the deformation does not fold at the shape's corners.
"""

from __future__ import annotations

import math
from functools import lru_cache

import torch
from torch import Tensor

from kpred.ops.nearest import nearest_neighbours
from kpred.ops.typing import Float, Int

PULL_STEPS = 100
PULL_RATE = 0.99
CLEARANCE = 0.4
"""Distance from the shape at which a cage vertex stops, in unit-box units."""


@lru_cache(maxsize=8)
def icosphere(subdivisions: int = 1) -> tuple[Float[Tensor, "vertices 3"], Int[Tensor, "faces 3"]]:
    """Build a unit icosphere with outward faces: 12 vertices and 20 triangles, 42 and 80 after one subdivision."""
    golden = (1 + 5**0.5) / 2
    corners = [
        (-1, golden, 0), (1, golden, 0), (-1, -golden, 0), (1, -golden, 0),
        (0, -1, golden), (0, 1, golden), (0, -1, -golden), (0, 1, -golden),
        (golden, 0, -1), (golden, 0, 1), (-golden, 0, -1), (-golden, 0, 1),
    ]  # fmt: skip
    triangles = [
        (0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11),
        (1, 5, 9), (5, 11, 4), (11, 10, 2), (10, 7, 6), (7, 1, 8),
        (3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8), (3, 8, 9),
        (4, 9, 5), (2, 4, 11), (6, 2, 10), (8, 6, 7), (9, 8, 1),
    ]  # fmt: skip
    vertices = [torch.nn.functional.normalize(torch.tensor(c, dtype=torch.float64), dim=0) for c in corners]
    for _ in range(subdivisions):
        middle: dict[tuple[int, int], int] = {}

        def midpoint(a: int, b: int, middle: dict[tuple[int, int], int] = middle) -> int:
            edge = (min(a, b), max(a, b))
            if edge not in middle:
                middle[edge] = len(vertices)
                vertices.append(torch.nn.functional.normalize(vertices[a] + vertices[b], dim=0))
            return middle[edge]

        split = []
        for a, b, c in triangles:
            ab, bc, ca = midpoint(a, b), midpoint(b, c), midpoint(c, a)
            split += [(a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)]
        triangles = split
    return torch.stack(vertices).float(), torch.tensor(triangles)


def pulled_in_cage(
    points: Float[Tensor, "batch points 3"], radius: float = 1.4, subdivisions: int = 1
) -> Float[Tensor, "batch vertices 3"]:
    """Pull a sphere of 1.4x the unit box to the origin until each vertex is within 0.4 of the shape.

    100 steps of 1 %; a vertex stops for good by itself, since only those farther than the clearance move.
    Points in the unit box; the cage's faces are those of `icosphere(subdivisions)`.
    """
    directions = icosphere(subdivisions)[0].to(points)
    cage = (directions * radius).expand(len(points), -1, -1).clone()
    left = torch.full(cage.shape[:2], PULL_STEPS, device=cage.device)
    while True:
        squared, _ = nearest_neighbours(cage, points)
        moving = (squared > CLEARANCE**2) & (left > 0)
        if not moving.any():
            return cage
        steps = torch.where(moving, _safe_steps(squared.sqrt(), cage.norm(dim=-1)), 0).minimum(left)
        left = left - steps
        for step in range(int(steps.max())):
            cage = torch.where((step < steps)[..., None], cage * PULL_RATE, cage)


def _safe_steps(distance: Float[Tensor, "batch vertices"], length: Float[Tensor, "batch vertices"]) -> Tensor:
    """Return the minimum number of steps for a vertex at `length` from the origin and `distance` from the shape.

    A vertex comes no closer to the shape than it moves, so the steps between need no search (as in sphere tracing).
    """
    free = ((distance - CLEARANCE - 1e-4) / length).clamp(0, 0.99)
    return (torch.log1p(-free) / math.log(PULL_RATE)).floor().long().clamp(min=1)


def enclosing_cage(
    points: Float[Tensor, "batch points 3"], margin: float = 0.1, radius: float = 2.2, subdivisions: int = 1
) -> Float[Tensor, "batch vertices 3"]:
    """Build a `pulled_in_cage` from a wider sphere, held at least `margin` outside the shape.

    A cage that is star-shaped about the origin with vertices r_v d_v contains p = sum_i a_i d_i (d_i the directions of
    the face whose cone holds p, a_i >= 0) exactly if sum_i a_i / r_i <= 1. Hence r_v >= sum_i a_i / (1 - margin) over
    all points in the cones around v is enough.
    """
    directions, faces = icosphere(subdivisions)
    directions, faces = directions.to(points), faces.to(points.device)
    cage = pulled_in_cage(points, radius, subdivisions)
    inverse = torch.linalg.inv(directions[faces].double()).to(points)
    coefficients = torch.einsum("bni,fij->bnfj", points, inverse)
    lowest, face = coefficients.amin(-1).max(-1)
    needed = torch.gather(coefficients.sum(-1), 2, face[..., None]).squeeze(-1) / (1 - margin)
    corner = faces[face].flatten(1)
    least = torch.zeros(cage.shape[:2], dtype=cage.dtype, device=cage.device)
    least.scatter_reduce_(1, corner, needed.repeat_interleave(3, dim=1), "amax")
    return directions * torch.maximum(cage.norm(dim=-1), least)[..., None]
