"""Occlusion: how full clouds become partial scans, by a random plane or by a virtual depth camera."""

from __future__ import annotations

import torch
from torch import Tensor

from kpred.ops.sampling import sample_surface
from kpred.ops.typing import Bool, Float, Int

SAMPLES_PER_PIXEL = 16
"""Samples per pixel that a face covers: enough that practically none is left open for what is behind to show."""
MAX_SAMPLES = 2_000_000
SLANT = 1.5
"""Depth, in pixel widths, that one pixel of a dense cloud's depth image may span."""


def random_directions(
    count: int, generator: torch.Generator | None = None, device: torch.device | str = "cpu"
) -> Float[Tensor, "count 3"]:
    """Draw unit vectors, uniform on the sphere."""
    normal = torch.randn(count, 3, generator=generator, device=device)
    return torch.nn.functional.normalize(normal, dim=1)


def slice_by_plane(
    points: Float[Tensor, "batch points 3"], ratio: Float[Tensor, " batch"], normal: Float[Tensor, "batch 3"]
) -> Bool[Tensor, "batch points"]:
    """Mask of the points that stay visible when a plane with this normal cuts away a fraction `ratio` of them.

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
    """Draw indices of `count` visible points, without repeats while there are enough."""
    noise = torch.rand(visible.shape, generator=generator, device=points.device)
    order = torch.argsort(torch.where(visible, noise, 2.0), dim=1)
    available = visible.sum(1, keepdim=True).clamp(min=1)
    slot = torch.arange(count, device=points.device)[None] % available
    return torch.gather(order, 1, slot)


def visible_to_camera(
    points: Float[Tensor, "batch points 3"], cameras: Float[Tensor, "batch 3"], resolution: int
) -> Bool[Tensor, "batch points"]:
    """Mask of the points of each dense cloud that a depth camera at `cameras`, looking at its middle, would see.

    The points hide each other through a depth image of resolution x resolution pixels. The clouds must be so dense
    that every pixel on the object holds points of its nearest surface (some 8 points a pixel); the exact, slower way
    from a mesh is `depth_scan`. Any frame with y up.
    """
    low, high = points.amin(1), points.amax(1)
    forward = torch.nn.functional.normalize((low + high) / 2 - cameras, dim=1)
    up = torch.zeros_like(forward)
    up[:, 1] = 1.0
    right = torch.nn.functional.normalize(torch.linalg.cross(forward, up, dim=1), dim=1)
    axes = torch.stack([right, torch.linalg.cross(right, forward, dim=1), forward], dim=1)
    local = (points - cameras[:, None]) @ axes.mT
    depth = local[..., 2].clamp(min=1e-6)
    plane = local[..., :2] / depth[..., None]
    corner = plane.amin(1, keepdim=True)
    width = (plane.amax(1, keepdim=True) - corner).amax(2, keepdim=True).clamp(min=1e-9) / (resolution - 1)
    column, row = ((plane - corner) / width).round().long().unbind(-1)
    pixel = row * resolution + column
    inverse = torch.zeros(len(points), resolution * resolution, dtype=points.dtype, device=points.device)
    inverse.scatter_reduce_(1, pixel, 1 / depth, "amax")
    # Within a pixel a surface may be slanted; more than this behind its nearest point is hidden.
    return depth <= 1 / torch.gather(inverse, 1, pixel) + SLANT * width[..., 0] * depth


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
    """Render the points of a mesh that a depth camera at `camera` sees, in the mesh's frame and units.

    The field of view holds the object. The mesh is rasterised into a depth image of resolution x resolution pixels, and
    a surface point is seen if it lies no deeper than its pixel allows, so that surfaces hide what is behind them.

    Args:
        count: most points returned (fewer if less is seen).
        noise: standard deviation along the viewing ray, as a fraction of the object's half extent.
        dropout: fraction of pixels lost at random, as where a surface reflects badly.
        outliers: fraction of returned points replaced by points anywhere in a box 1.2 times the object's.
    """
    dense, face = sample_surface(vertices, faces, 6 * resolution * resolution, generator)
    low, high = dense.amin(0), dense.amax(0)
    middle, half = (low + high) / 2, float((high - low).amax() / 2)
    axes = _camera_axes(middle - camera)
    corners, _ = _project(vertices, camera, axes, half)
    used = corners[faces.flatten()]
    corner, extent = used.amin(0), float((used.amax(0) - used.amin(0)).amax().clamp(min=1e-9))
    per_pixel = extent / (resolution - 1)

    plane, depth = _project(dense, camera, axes, half)
    pixel = ((plane - corner) / per_pixel).round().long().clamp(0, resolution - 1)
    flat = pixel[:, 1] * resolution + pixel[:, 0]
    nearest, owner = _depth_image(vertices, faces, camera, axes, half, corner, per_pixel, resolution, generator)
    # A flat face cannot hide itself, however slanted; of all others a pixel shows what is within its own width.
    clear = (depth <= nearest[flat] + per_pixel * depth) | (owner[flat] == face)
    lost = torch.rand(resolution * resolution, generator=generator, device=dense.device) < dropout
    seen = dense[clear & ~lost[flat]]
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


def _camera_axes(forward: Float[Tensor, "3"]) -> Float[Tensor, "3 3"]:
    """Return rows right, up and forward of a camera that looks along `forward`."""
    forward = torch.nn.functional.normalize(forward, dim=0)
    helper = torch.tensor([0.0, 1.0, 0.0] if abs(float(forward[1])) < 0.95 else [1.0, 0.0, 0.0]).to(forward)
    right = torch.nn.functional.normalize(torch.linalg.cross(forward, helper), dim=0)
    return torch.stack([right, torch.linalg.cross(right, forward), forward])


def _project(points: Tensor, camera: Tensor, axes: Tensor, half: float) -> tuple[Tensor, Tensor]:
    """Project to image coordinates (N, 2) at unit focal length, and depths (N,)."""
    local = (points - camera) @ axes.T
    depth = local[:, 2].clamp(min=1e-3 * half)
    return local[:, :2] / depth[:, None], depth


def _depth_image(
    vertices: Tensor,
    faces: Tensor,
    camera: Tensor,
    axes: Tensor,
    half: float,
    corner: Tensor,
    per_pixel: float,
    resolution: int,
    generator: torch.Generator | None,
) -> tuple[Float[Tensor, " pixels"], Int[Tensor, " pixels"]]:
    """Render depth and face of the nearest surface in each pixel; infinite and -1 without one."""
    plane, depth = _project(vertices, camera, axes, half)
    # In the image the inverse depth is linear over a triangle, so that samples of this flattened mesh, spread by
    # projected area and not by true area, fill every pixel that a face covers.
    flattened = torch.cat([(plane - corner) / per_pixel, (half / depth)[:, None]], dim=1)
    edges = flattened[faces]
    doubled = torch.linalg.cross(edges[:, 1] - edges[:, 0], edges[:, 2] - edges[:, 0]).norm(dim=1).sum()
    count = min(max(int(SAMPLES_PER_PIXEL * float(doubled) / 2), resolution * resolution), MAX_SAMPLES)
    samples, face = sample_surface(flattened, faces, count, generator)
    pixel = samples[:, :2].round().long().clamp(0, resolution - 1)
    flat = pixel[:, 1] * resolution + pixel[:, 0]
    inverse = torch.zeros(resolution * resolution, dtype=vertices.dtype, device=vertices.device)
    inverse.scatter_reduce_(0, flat, samples[:, 2], "amax")
    owner = torch.full_like(inverse, -1, dtype=torch.long)
    first = samples[:, 2] == inverse[flat]
    owner[flat[first]] = face[first]
    return half / inverse, owner
