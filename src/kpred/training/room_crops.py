"""Training clouds cut from scanned rooms as a segmentation cuts them: pieces missing, pieces of neighbours left."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor

from kpred.errors import PackError
from kpred.ops.occlusion import random_directions
from kpred.ops.typing import Bool, Float, Int
from kpred.synthetic.rooms.pack import GRID, SURFACE_POINTS, UNIT, RoomPack
from kpred.training.data import Progress
from kpred.training.recognition_data import AT_ONCE, OTHER, category_index, chances, yaw_periods

OWN_POINTS, NEAR_POINTS = 640, 192
"""Points of an object, and of what is around it, that are kept of a crop; they repeat where there are fewer."""

MIN_POINTS = 60
"""Objects with fewer points are no crops."""

MARGIN = 0.12
"""Metres around an object's points within which points of others may be taken for its own."""

UNDECIDABLE = ("box", "computer")
"""Other things that look like cabinets when size is not known."""


@dataclass(frozen=True, eq=False)
class RoomCrops:
    """Crops of scanned rooms, each in the unit box and the canonical frame of its whole object.

    Attributes:
        categories: names; `category` (C,) is an index into them, or their number for other things.
        period: (C,) as in `kpred.training.recognition_data.RecognitionData`; 0 for other things.
        own: (C, OWN_POINTS, 3) points of the object, in random order, half precision; own_count (C,): how many of them,
            the first ones, are no repeats.
        near: (C, NEAR_POINTS, 3) points of what is around it; near_count (C,): how many of them are no repeats.
        surface: (C, SURFACE_POINTS, 3) points of the whole surface, half precision; seen: whether the scanner saw them.
        grid: (C, GRID, GRID, GRID) bool: whether surface at a node would have been seen.
    """

    categories: tuple[str, ...]
    category: Int[Tensor, " crops"]
    period: Float[Tensor, " crops"]
    own: Float[Tensor, "crops own 3"]
    own_count: Int[Tensor, " crops"]
    near: Float[Tensor, "crops near 3"]
    near_count: Int[Tensor, " crops"]
    surface: Float[Tensor, "crops surface 3"]
    seen: Bool[Tensor, "crops surface"]
    grid: Bool[Tensor, "crops x y z"]

    def numbers(self) -> dict[str, int]:
        """Count the crops of each category and of other things."""
        counts = torch.bincount(self.category, minlength=len(self.categories) + 1).tolist()
        return dict(zip((*self.categories, OTHER), counts, strict=True))

    def draw(self, count: int, others: float, generator: torch.Generator) -> Int[Tensor, " count"]:
        """Draw random crops as `kpred.training.recognition_data.chances` says."""
        chance = chances(self.category, len(self.categories), others)
        return torch.multinomial(chance, count, replacement=True, generator=generator)


def prepare_crops(
    packs: Sequence[RoomPack],
    categories: Sequence[str],
    seed: int,
    device: torch.device | str = "cpu",
    progress: Progress | None = None,
) -> RoomCrops:
    """Cut every furniture and every large other thing out of scanned rooms.

    Raises:
        PackError: if there is no crop of any of the categories.
    """
    rng = np.random.default_rng(seed)
    names = tuple(categories)
    columns: list[tuple[Any, ...]] = []
    total, done = sum(len(pack) for pack in packs), 0
    for pack in packs:
        for index in range(len(pack)):
            columns += _crops_of_room(pack, index, names, rng)
            done += 1
            if progress:
                progress("cutting crops", done, total)
    if all(kind == len(names) for kind, *_ in columns):
        raise PackError(f"The room packs hold no crop of {', '.join(names)}; give packs with more rooms.")
    kind, own, own_count, near, near_count, surface, seen, grid = zip(*columns, strict=True)
    kinds = torch.tensor(kind, device=device)
    surfaces = torch.from_numpy(np.stack(surface)).to(device)
    periods = [yaw_periods(*part.float().chunk(2, dim=1)) for part in surfaces.split(AT_ONCE)]
    return RoomCrops(
        names,
        kinds,
        torch.where(kinds < len(names), torch.cat(periods), 0.0),
        torch.from_numpy(np.stack(own)).to(device),
        torch.tensor(own_count, device=device),
        torch.from_numpy(np.stack(near)).to(device),
        torch.tensor(near_count, device=device),
        surfaces,
        torch.from_numpy(np.stack(seen)).to(device),
        torch.from_numpy(np.stack(grid)).to(device),
    )


def _crops_of_room(
    pack: RoomPack, index: int, names: tuple[str, ...], rng: np.random.Generator
) -> list[tuple[Any, ...]]:
    points, instance, objects = pack.room(index)
    found = []
    for number, row in enumerate(range(objects.start, objects.stop)):
        category, name, line = str(pack.category[row]), str(pack.name[row]), int(pack.surface_row[row])
        kind = category_index(category, name, names)
        if line < 0 or category not in (*names, OTHER) or (kind == len(names) and name in UNDECIDABLE):
            continue
        mine = points[instance == number]
        if len(mine) < MIN_POINTS:
            continue
        low, high = mine.min(axis=0) - MARGIN, mine.max(axis=0) + MARGIN
        around = points[(instance != number) & ((points >= low) & (points <= high)).all(axis=1)]
        pose, box = pack.pose[row], pack.box[row]
        middle, half = box.mean(axis=0), float(np.ptp(box, axis=0).max()) / 2

        def canonical(cloud: np.ndarray, pose: np.ndarray = pose, middle: Any = middle, half: float = half) -> Any:
            return (((cloud - pose[:3, 3]) @ pose[:3, :3] - middle) / half).astype(np.float16)

        surface = ((pack.surface[line].astype(np.float32) * UNIT - middle) / half).astype(np.float16)
        seen = np.unpackbits(pack.seen[line]).astype(bool)[:SURFACE_POINTS]
        grid = np.unpackbits(pack.grid[line])[: GRID**3].astype(bool).reshape(GRID, GRID, GRID)
        near = _resized(around, NEAR_POINTS, rng) if len(around) else np.zeros((NEAR_POINTS, 3), np.float32)
        own = canonical(_resized(mine, OWN_POINTS, rng))
        own_count, near_count = min(len(mine), OWN_POINTS), min(len(around), NEAR_POINTS)
        found.append((kind, own, own_count, canonical(near), near_count, surface, seen, grid))
    return found


def _resized(cloud: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
    """Sample points (count, 3) in random order; they repeat where there are fewer."""
    return np.asarray(cloud[np.resize(rng.permutation(len(cloud)), count)])


def segmented(
    crops: RoomCrops, rows: Int[Tensor, " batch"], count: int, generator: torch.Generator, strength: float = 1.0
) -> Float[Tensor, "batch count 3"]:
    """Draw crops as a segmentation gives them, unit box of the whole object; points repeat where there are few.

    Half of them miss a piece (what lies beyond a plane, or around a point: up to 45 % of the points); three of four
    have connected pieces of neighbours, floor or wall, up to 15 % of their points. `strength` scales both.
    """
    options: dict[str, Any] = {"generator": generator, "device": crops.own.device}
    batch = len(rows)
    own, near = crops.own[rows].float(), crops.near[rows].float()
    cut, kind, has_piece, fraction = torch.rand(4, batch, 1, **options)
    real, near_real = (
        torch.arange(points.shape[1], device=own.device)[None] < number[rows][:, None]
        for points, number in ((own, crops.own_count), (near, crops.near_count))
    )
    row = torch.arange(batch, device=own.device)
    height = (own * random_directions(batch, generator, own.device)[:, None]).sum(2)
    pivot = torch.randint(0, own.shape[1], (batch,), **options)
    nearness = -(own - own[row, pivot][:, None]).norm(dim=2)
    order = _ranks(torch.where(kind < 0.5, height, nearness).masked_fill(~real, -torch.inf))
    missing = torch.where(cut < 0.5, 0.9 * cut * strength, 0.0) * crops.own_count[rows][:, None]
    # The points that rank highest are missing; repeats rank lowest.
    keep = (order < own.shape[1] - missing) & real
    anchor = torch.randint(0, near.shape[1], (batch,), **options)
    away = (near - near[row, anchor][:, None]).norm(dim=2).masked_fill(~near_real, torch.inf)
    allowed = torch.where(has_piece < 0.75, 0.15 * fraction * strength, 0.0) * keep.sum(1, keepdim=True)
    piece = (_ranks(away) < allowed) & near_real
    cloud, valid = torch.cat([own, near], dim=1), torch.cat([keep, piece], dim=1)
    chance = torch.where(valid, torch.rand(valid.shape, **options), -1.0)
    chosen = chance.topk(min(count, chance.shape[1]), dim=1).indices
    slot = torch.arange(count, device=own.device)[None] % valid.sum(1, keepdim=True).clamp(1, chosen.shape[1])
    return torch.gather(cloud, 1, torch.gather(chosen, 1, slot)[..., None].expand(-1, -1, 3))


def _ranks(values: Tensor) -> Tensor:
    """Rank (0 for the least) of each value in its row."""
    return values.argsort(dim=1).argsort(dim=1)
