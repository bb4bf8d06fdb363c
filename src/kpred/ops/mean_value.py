"""Mean value coordinates of points with respect to a closed triangle mesh (Ju, Schaefer, Warren 2005), batched."""

from __future__ import annotations

import torch
from torch import Tensor

from kpred.ops.typing import Float, Int

try:
    from kpred.ops.mean_value_cpu import mean_value_cpu
except ImportError:  # numba is absent on machines that only train
    mean_value_cpu = None  # type: ignore[assignment]

POINT_CHUNK = 1024
"""Points handled at once; with 80 cage faces this keeps the working set within a few tens of megabytes."""


def mean_value_coordinates(
    points: Float[Tensor, "batch points 3"],
    cage: Float[Tensor, "batch vertices 3"],
    faces: Int[Tensor, "faces 3"],
) -> Float[Tensor, "batch points vertices"]:
    """Compute weights W with W @ cage = points and rows that sum to one.

    Points on a cage vertex, edge or face get that element's own (barycentric) weights, the limit of the formula.
    Computed in double precision, returned in the precision of `points`. Winding of `faces` must be consistent.
    """
    if mean_value_cpu is not None and points.device.type == "cpu" and not (points.requires_grad or cage.requires_grad):
        return torch.from_numpy(mean_value_cpu(points.numpy(), cage.numpy(), faces.numpy())).to(points.dtype)
    return mean_value_reference(points, cage, faces)


def mean_value_reference(
    points: Float[Tensor, "batch points 3"],
    cage: Float[Tensor, "batch vertices 3"],
    faces: Int[Tensor, "faces 3"],
    chunk: int = POINT_CHUNK,
) -> Float[Tensor, "batch points vertices"]:
    """Compute `mean_value_coordinates` in plain torch, `chunk` points at once; differentiable, on every device."""
    parts = [_coordinates(part.double(), cage.double(), faces) for part in points.split(chunk, dim=1)]
    return torch.cat(parts, dim=1).to(points.dtype)


def _coordinates(points: Tensor, cage: Tensor, faces: Tensor) -> Tensor:
    batch, count = points.shape[:2]
    size = cage.norm(dim=-1).amax(-1)[:, None, None].clamp(min=1e-12)
    offset = cage[:, None] - points[:, :, None]
    distance = offset.norm(dim=-1)
    direction = offset / distance.clamp(min=1e-300)[..., None]

    u = direction[:, :, faces]
    # cross[i] is normal to the plane through the point and the edge opposite corner i.
    cross = torch.linalg.cross(u.roll(-1, 3), u.roll(-2, 3))
    length = cross.norm(dim=-1)
    angle = torch.atan2(length, (u.roll(-1, 3) * u.roll(-2, 3)).sum(-1))
    determinant = (u[..., 0, :] * cross[..., 0, :]).sum(-1)
    mean_vector = (angle / length.clamp(min=1e-300) / 2)[..., None].mul(cross).sum(3)

    coplanar = determinant.abs() < 1e-10
    on_face = (torch.pi - angle.sum(-1) / 2) < 1e-6
    projection = (mean_vector[..., None, :] * cross).sum(-1)
    corner_distance = distance[:, :, faces]
    denominator = torch.where(coplanar, 1.0, determinant)[..., None] * corner_distance.clamp(min=1e-300)
    weight = torch.where((coplanar | on_face)[..., None], 0.0, projection / denominator)

    vertices = cage.shape[1]
    total = torch.zeros(batch, count, vertices, dtype=points.dtype, device=points.device)
    columns = faces.reshape(-1).expand(batch, count, -1)
    total.scatter_add_(2, columns, weight.flatten(2))

    # The limits, rare: a point on a face takes that face's barycentric weights, on a vertex the vertex alone.
    touches = on_face.any(-1)
    if touches.any():
        pairs = corner_distance.roll(-1, 3) * corner_distance.roll(-2, 3)
        inside = torch.where(on_face[..., None], angle.sin() * pairs, 0.0)
        first = on_face & (on_face.cumsum(-1) == 1)
        flat = torch.zeros_like(total).scatter_add_(2, columns, (inside * first[..., None]).flatten(2))
        total = torch.where(touches[..., None], flat, total)
    at_vertex = distance < 1e-9 * size
    touching = at_vertex.any(-1, keepdim=True)
    total = torch.where(touching, (at_vertex & (at_vertex.cumsum(-1) == 1)).to(total.dtype), total)
    return total / total.sum(-1, keepdim=True)
