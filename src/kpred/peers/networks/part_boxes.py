"""Parts of a source as boxes, moved and resized with their contacts kept (Uy et al. 2021)."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import NamedTuple

import torch
from torch import Tensor

from kpred.ops.nearest import squared_distance_matrix
from kpred.ops.typing import Float, Int

THINNEST = 0.02
"""Half of the least thickness that a part is given, unit box: a plate's own would make its size count for nothing."""

BOX_GAP, POINT_GAP = 0.03, 0.15
"""Parts touch if their boxes are no farther apart than the first along any axis, and their samples than the second."""


@dataclass(frozen=True, eq=False)
class PartBoxes:
    """Sources cut into axis-aligned parts, unit box; parts are filled up with empty ones to a common number.

    A point p of a part with centre c and half size h goes to p + m + (p - c) / h * g, where the part moves by m and
    grows by g (both half sizes and lengths of the unit box). Where two parts touch, both must take the touching point
    to the same place, which is linear in all m and g of one axis: `projection` is the least-squares projection of
    any wanted m and g onto those that keep all contacts.

    Attributes:
        labels: (..., N) part of each point; relative: (..., N, 3) (p - c) / h.
        parts: (..., P) whether there is such a part.
        projection: (..., 3, 2P, 2P), for each axis, of (m_1 .. m_P, g_1 .. g_P).
    """

    labels: Tensor
    relative: Tensor
    parts: Tensor
    projection: Tensor

    @classmethod
    def of_shape(cls, points: Float[Tensor, "points 3"], labels: Int[Tensor, " points"], count: int) -> PartBoxes:
        """Build one source from its points and the part of each, 0 to `count` - 1."""
        low, high = points.new_full((count, 3), torch.inf), points.new_full((count, 3), -torch.inf)
        rows = labels[:, None].expand(-1, 3)
        low.scatter_reduce_(0, rows, points, "amin")
        high.scatter_reduce_(0, rows, points, "amax")
        parts = torch.isfinite(low[:, 0])
        low, high = torch.where(parts[:, None], low, 0), torch.where(parts[:, None], high, 0)
        center, half = (low + high) / 2, ((high - low) / 2).clamp(min=THINNEST)
        first, second, place = contacts(points, labels, low, high, parts)
        projection = torch.stack(
            [_projection(first, second, (place - center[first]) / half[first], (place - center[second]) / half[second],
                         axis, parts) for axis in range(3)]
        )  # fmt: skip
        relative = (points - center[labels]) / half[labels]
        return cls(labels, relative, parts, projection)

    @classmethod
    def stack(cls, shapes: list[PartBoxes]) -> PartBoxes:
        """Stack several sources with equal numbers of points and parts."""
        return cls(*(torch.stack([getattr(shape, field.name) for shape in shapes]) for field in fields(cls)))

    def take(self, rows: Int[Tensor, " rows"]) -> PartBoxes:
        """Select the sources of these rows."""
        return PartBoxes(*(getattr(self, field.name)[rows] for field in fields(self)))

    def first(self, count: int) -> PartBoxes:
        """Return the same with each source's first points only."""
        return PartBoxes(self.labels[..., :count], self.relative[..., :count, :], self.parts, self.projection)

    def to(self, device: torch.device | str) -> PartBoxes:
        """Move all arrays to a device."""
        return PartBoxes(*(getattr(self, field.name).to(device) for field in fields(self)))

    def moved(
        self, points: Float[Tensor, "batch points 3"], wanted: Float[Tensor, "batch parts 6"]
    ) -> Float[Tensor, "batch points 3"]:
        """Move the points with their parts' shift (first three numbers) and growth (last three), contacts kept."""
        wanted = torch.where(self.parts[..., None], wanted, 0)
        per_axis = torch.cat([wanted[..., :3], wanted[..., 3:]], dim=1).transpose(1, 2)
        kept = torch.einsum("bapq,baq->bpa", self.projection.to(wanted.dtype), per_axis)
        move, grow = kept.chunk(2, dim=1)
        index = self.labels[..., None].expand(-1, -1, 3)
        return points + torch.gather(move, 1, index) + self.relative * torch.gather(grow, 1, index)


class Contacts(NamedTuple):
    """Pairs of touching parts (C,), and a point (C, 3) of each contact."""

    first: Int[Tensor, " contacts"]
    second: Int[Tensor, " contacts"]
    points: Float[Tensor, "contacts 3"]


def contacts(
    points: Float[Tensor, "points 3"],
    labels: Int[Tensor, " points"],
    low: Float[Tensor, "parts 3"],
    high: Float[Tensor, "parts 3"],
    parts: Tensor,
) -> Contacts:
    """Find pairs of touching parts, and their points; a part without contact is tied to its nearest.

    Args:
        low, high: the parts' boxes.
    """
    count = len(low)
    squared = squared_distance_matrix(points[None], points[None])[0]
    # Nearest sample of every part to every point, then of every pair of parts.
    row = labels[:, None]
    to_part = squared.new_full((count, len(points)), torch.inf)
    to_part.scatter_reduce_(0, row.expand_as(squared), squared, "amin")
    between = squared.new_full((count, count), torch.inf)
    between.scatter_reduce_(0, row.expand(-1, count), to_part.T, "amin")
    gap = torch.maximum(low[:, None] - high[None], low[None] - high[:, None]).amax(2)
    touch = (gap <= BOX_GAP) & (between <= POINT_GAP**2)
    apart = between.clone().fill_diagonal_(torch.inf)
    touch.fill_diagonal_(False)
    for part in (parts & ~touch.any(1)).nonzero().flatten().tolist():
        if torch.isfinite(apart[part]).any():
            nearest = int(apart[part].argmin())
            touch[part, nearest] = touch[nearest, part] = True
    first, second = touch.triu(1).nonzero().unbind(1)
    places = []
    for i, j in zip(first.tolist(), second.tolist(), strict=True):
        ours, theirs = (labels == i).nonzero().flatten(), (labels == j).nonzero().flatten()
        pair = squared[ours][:, theirs]
        nearest = int(pair.argmin())
        places.append((points[ours[nearest // len(theirs)]] + points[theirs[nearest % len(theirs)]]) / 2)
    place = torch.stack(places) if places else points.new_zeros(0, 3)
    return Contacts(first, second, place)


def _projection(first: Tensor, second: Tensor, at_first: Tensor, at_second: Tensor, axis: int, parts: Tensor) -> Tensor:
    """Compute the projection (2P, 2P) that keeps the contacts along one axis."""
    count, rows = len(parts), torch.arange(len(first), device=first.device)
    wanted = torch.zeros(len(first), 2 * count, dtype=torch.float64, device=first.device)
    wanted[rows, first], wanted[rows, second] = 1.0, -1.0
    wanted[rows, count + first] = at_first[:, axis].double()
    wanted[rows, count + second] = -at_second[:, axis].double()
    identity = torch.eye(2 * count, dtype=torch.float64, device=first.device)
    if not len(first):
        return identity.to(at_first.dtype)
    return (identity - torch.linalg.pinv(wanted, rtol=1e-6) @ wanted).to(at_first.dtype)
