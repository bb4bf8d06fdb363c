"""Point sampling: uniform on surfaces, and farthest-point subsets."""

from __future__ import annotations

import torch
from torch import Tensor

from kpred.errors import MeshError
from kpred.ops.typing import Float, Int


def sample_surface(
    vertices: Float[Tensor, "vertices 3"],
    faces: Int[Tensor, "faces 3"],
    count: int,
    generator: torch.Generator | None = None,
) -> tuple[Float[Tensor, "count 3"], Int[Tensor, " count"]]:
    """Draw points uniformly by area on a triangle mesh, in the mesh's own frame and units, in random order.

    Returns:
        The points and the face that each lies on.

    Raises:
        MeshError: if the mesh has no face of non-zero area.
    """
    corners = vertices[faces]
    doubled = torch.linalg.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]).norm(dim=-1)
    cumulative = doubled.double().cumsum(0)
    if len(cumulative) == 0 or not cumulative[-1] > 0:
        raise MeshError("The mesh has no face of non-zero area, so no point can be sampled on it.")
    # One stratified draw along the cumulative area: less clumped than independent draws, same density.
    jitter = torch.rand(count, generator=generator, dtype=torch.float64, device=vertices.device)
    strata = torch.arange(count, dtype=torch.float64, device=vertices.device)
    position = (strata + jitter) / count * cumulative[-1]
    face = torch.searchsorted(cumulative, position).clamp(max=len(cumulative) - 1)
    # In random order, so that the first points are a fair sample too.
    face = face[torch.randperm(count, generator=generator, device=vertices.device)]
    u, v = torch.rand(2, count, 1, generator=generator, dtype=vertices.dtype, device=vertices.device)
    root = u.sqrt()
    a, b, c = corners[face].unbind(1)
    return (1 - root) * a + root * (1 - v) * b + root * v * c, face


def farthest_point_sampling(points: Float[Tensor, "batch points 3"], count: int) -> Int[Tensor, "batch count"]:
    """Select `count` points, each farthest from those before; the first is farthest from the centroid.

    Independent of the order of the points up to ties, so that the same shape gives the same subset.
    """
    batch = torch.arange(len(points), device=points.device)
    distance = (points - points.mean(dim=1, keepdim=True)).square().sum(-1)
    chosen = torch.empty(len(points), count, dtype=torch.long, device=points.device)
    for k in range(count):
        farthest = distance.argmax(dim=1)
        chosen[:, k] = farthest
        to_new = (points - points[batch, farthest][:, None]).square().sum(-1)
        distance = to_new if k == 0 else torch.minimum(distance, to_new)
    return chosen


def subsample(points: Float[Tensor, "*batch points 3"], max_count: int | None) -> Float[Tensor, "*batch few 3"]:
    """Select points at even steps, at least `max_count` if there are so many; all for None."""
    step = 1 if max_count is None else max(1, points.shape[-2] // max_count)
    return points if step == 1 else points[..., ::step, :].contiguous()
