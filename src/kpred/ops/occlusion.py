"""Occlusion: how full clouds become partial scans, by a random plane or by a virtual depth camera."""

from __future__ import annotations

import torch
from torch import Tensor

from kpred.ops.sampling import sample_surface
from kpred.ops.typing import Bool, Float, Int


def random_directions(
    count: int, generator: torch.Generator | None = None, device: torch.device | str = "cpu"
) -> Float[Tensor, "count 3"]:
    """Unit vectors, uniform on the sphere."""
    normal = torch.randn(count, 3, generator=generator, device=device)
    return torch.nn.functional.normalize(normal, dim=1)


def slice_by_plane(
    points: Float[Tensor, "batch points 3"], ratio: Float[Tensor, " batch"], normal: Float[Tensor, "batch 3"]
) -> Bool[Tensor, "batch points"]:
    """Mask of the points that stay visible when a plane with this normal cuts away a share `ratio` of them.

    The paper's random slicing: exactly round(ratio * points) points, those farthest along the normal, are hidden.
    """
    height = (points * normal[:, None]).sum(-1)
    rank = height.argsort(dim=1).argsort(dim=1)
    keep = points.shape[1] - (ratio * points.shape[1]).round().long()
    return rank < keep[:, None]


def resample_visible(
    points: Float[Tensor, "batch points 3"],
    visible: Bool[Tensor, "batch points"],
    count: int,
    generator: torch.Generator | None = None,
) -> Int[Tensor, "batch count"]:
    """Indices of `count` visible points drawn at random: without repeats while there are enough, then repeating."""
    noise = torch.rand(visible.shape, generator=generator, device=points.device)
    order = torch.argsort(torch.where(visible, noise, 2.0), dim=1)
    available = visible.sum(1, keepdim=True).clamp(min=1)
    slot = torch.arange(count, device=points.device)[None] % available
    return torch.gather(order, 1, slot)


def depth_scan(
    vertices: Float[Tensor, "vertices 3"],
    faces: Int[Tensor, "faces 3"],
    camera: Float[Tensor, "3"],
    count: int,
    resolution: int = 160,
    noise: float = 0.0,
    dropout: float = 0.0,
    outliers: float = 0.0,
    generator: torch.Generator | None = None,
) -> Float[Tensor, "seen 3"]:
    """Points that a depth camera at `camera` sees of a mesh, in the mesh's frame and units.

    A dense surface sample is splatted into a depth image of resolution x resolution pixels whose field of view holds
    the object; what lies within a pixel's depth tolerance of the nearest sample is seen, so that surfaces hide what is
    behind them.

    Args:
        count: most points returned (fewer if less is seen).
        noise: standard deviation along the viewing ray, as a share of the object's half extent.
        dropout: share of pixels lost at random, as where a surface reflects badly.
        outliers: share of returned points replaced by points anywhere in a box 1.2 times the object's.
    """
    dense, _ = sample_surface(vertices, faces, 6 * resolution * resolution, generator)
    low, high = dense.amin(0), dense.amax(0)
    middle, half = (low + high) / 2, float((high - low).amax() / 2)
    forward = torch.nn.functional.normalize(middle - camera, dim=0)
    helper = torch.tensor([0.0, 1.0, 0.0]) if abs(float(forward[1])) < 0.95 else torch.tensor([1.0, 0.0, 0.0])
    right = torch.nn.functional.normalize(torch.linalg.cross(forward, helper.to(forward)), dim=0)
    up = torch.linalg.cross(right, forward)
    local = (dense - camera) @ torch.stack([right, up, forward]).T
    depth = local[:, 2].clamp(min=1e-3 * half)
    plane = local[:, :2] / depth[:, None]
    corner, extent = plane.amin(0), (plane.amax(0) - plane.amin(0)).amax().clamp(min=1e-9)
    pixel = ((plane - corner) / extent * (resolution - 1)).round().long()
    flat = pixel[:, 1] * resolution + pixel[:, 0]
    nearest = torch.full((resolution * resolution,), float("inf"), dtype=dense.dtype, device=dense.device)
    nearest.scatter_reduce_(0, flat, depth, "amin")
    tolerance = 3.0 * float(extent) / resolution * depth
    lost = torch.rand(resolution * resolution, generator=generator, device=dense.device) < dropout
    seen = dense[(depth <= nearest[flat] + tolerance) & ~lost[flat]]
    seen = seen[torch.randperm(len(seen), generator=generator, device=dense.device)[:count]]
    if noise > 0:
        ray = torch.nn.functional.normalize(seen - camera, dim=1)
        step = torch.randn(len(seen), 1, generator=generator, dtype=seen.dtype, device=seen.device)
        seen = seen + ray * step * (noise * half)
    stray = int(round(outliers * len(seen)))
    if stray:
        box = torch.rand(stray, 3, generator=generator, dtype=seen.dtype, device=seen.device) * 2 - 1
        seen = torch.cat([seen[stray:], middle + box * (high - low) * 0.6])
    return seen
