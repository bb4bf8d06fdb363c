"""Crops of scanned rooms as scans with known visibility."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from kpred.ops.typing import Bool, Float
from kpred.synthetic.rooms.pack import GRID, GRID_REACH
from kpred.training.augmentation import disturbed, random_factors
from kpred.training.room_crops import RoomCrops, segmented
from kpred.training.visibility_config import VisibilityTraining

BOX = 1.15
"""Half side of the box of random places, in half sides of a shape's box."""


@dataclass(frozen=True, eq=False)
class CropScans:
    """Crops as scans (about unit box, canonical yaw), places around them, and whether each would have been seen.

    The places are three equal groups: of the own surface, of another object's, of the box.
    """

    scans: Float[Tensor, "batch points 3"]
    places: Float[Tensor, "batch places 3"]
    seen: Bool[Tensor, "batch places"]


def draw_crop_scans(
    crops: RoomCrops, count: int, points: int, config: VisibilityTraining, generator: torch.Generator
) -> CropScans:
    """Draw crops of `points` points, and labelled places around them."""
    options: dict[str, Any] = {"generator": generator, "device": crops.own.device}
    rows = crops.draw(count, 0.0, generator)
    third = config.queries // 3
    slot = torch.randint(0, crops.surface.shape[1], (count, third), **options)
    own, seen = crops.surface[rows[:, None], slot].float(), crops.seen[rows[:, None], slot]
    others = crops.draw(count, 0.0, generator)
    other = crops.surface[others[:, None], slot].float()
    extent = crops.surface[rows].float().abs().amax(1, keepdim=True)
    box = BOX * extent * (2 * torch.rand(count, config.queries - 2 * third, 3, **options) - 1)
    around = torch.cat([other, box], dim=1)
    places = torch.cat([own, around], dim=1)
    labels = torch.cat([seen, grid_lookup(crops.grid[rows], around)], dim=1)
    factors = random_factors(count, config.stretch, generator)
    cloud = segmented(crops, rows, points, generator)
    cloud = disturbed(cloud * factors, config.noise, config.outliers, generator)
    return CropScans(cloud, places * factors, labels)


def grid_lookup(
    grid: Bool[Tensor, "batch x y z"], places: Float[Tensor, "batch places 3"]
) -> Bool[Tensor, "batch places"]:
    """Read visibility at the grid nodes nearest to places (unit box)."""
    node = ((places / GRID_REACH + 1) / 2 * (GRID - 1)).round().long().clamp(0, GRID - 1)
    flat = (node[..., 0] * GRID + node[..., 1]) * GRID + node[..., 2]
    return torch.gather(grid.flatten(1), 1, flat)
