"""Training data of the recognizer: dense clouds of all categories, of other things, and their symmetries."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from kpred.errors import PackError
from kpred.ops import nearest_neighbours
from kpred.ops.typing import Float, Int
from kpred.shapes.pack import MeshPack
from kpred.training.augmentation import yaw_matrices
from kpred.training.data import Progress
from kpred.training.dense_clouds import sampled_shapes

OTHER = "other"
"""Category of packs of things that are of none of the categories."""

SOFAS = ("sofa_two", "sofa_three", "chaise")
"""Factories of chair packs whose shapes are no chairs: a sofa has another category in every data set."""

CATEGORY_OF_NAME = {
    **dict.fromkeys(SOFAS, "sofa"),
    **dict.fromkeys(("potted_plant", "tree"), "plant"),
    **dict.fromkeys(("floor_lamp", "desk_lamp"), "lamp"),
    **dict.fromkeys(("screen", "laptop"), "display"),
    "vessel": "vase",
    "open_box": "box",
    "bin": "trash_bin",
}
"""Categories of things whose names differ from them; they count as other things where the category is not trained."""

SYMMETRY_POINTS = 1024
"""Number of points of each of the two samples for a shape's symmetry."""

YAW_TOLERANCE = 0.025
STRAY_DISTANCE = 0.12
STRAY_FRACTION = 0.04
"""A yaw maps a shape onto itself if it adds at most this to the mean distance of two samples (unit box), and to the
fraction of points beyond `STRAY_DISTANCE`: the corners of a square top are few, but decide its period."""

AT_ONCE = 32
"""Shapes whose symmetries are looked for together."""


@dataclass(frozen=True, eq=False)
class RecognitionData:
    """Shapes of several categories.

    Attributes:
        categories: names; `category` (shapes,) is an index into them, or their number for other things.
        clouds: (shapes, P, 3) dense whole surfaces, points in random order, in each shape's unit box; half precision.
        period: (shapes,) smallest turn about y that maps the shape onto itself: 2 pi, pi, pi / 2, or 0 if round.
    """

    categories: tuple[str, ...]
    category: Int[Tensor, " shapes"]
    clouds: Float[Tensor, "shapes points 3"]
    period: Float[Tensor, " shapes"]

    def draw(self, count: int, others: float, generator: torch.Generator) -> Int[Tensor, " count"]:
        """Draw random shapes as `chances` says."""
        chance = chances(self.category, len(self.categories), others)
        return torch.multinomial(chance, count, replacement=True, generator=generator)


def chances(category: Int[Tensor, " shapes"], known: int, others: float) -> Float[Tensor, " shapes"]:
    """Compute the probability of each shape to be drawn, by its category.

    Other things have the probability `others` together, if there are any. Of the `known` categories, each is drawn in
    proportion to the root of the number of its shapes: those with more variety more often, but no other one rarely.
    """
    number = torch.bincount(category, minlength=known + 1).float()
    weight = number.sqrt()
    weight[:known] *= (1 - others) / weight[:known].sum().clamp(min=1)
    weight[known] = others if number[known] > 0 else 0.0
    chance = (weight / number.clamp(min=1))[category]
    return chance / chance.sum()


def prepare_recognition(
    packs: Sequence[MeshPack],
    seed: int,
    device: torch.device | str = "cpu",
    progress: Progress | None = None,
) -> RecognitionData:
    """Sample the splits `source` and `train` of all packs.

    Raises:
        PackError: if there are fewer than two usable shapes, or no category beside other things.
    """
    generator = torch.Generator(device=device).manual_seed(seed)
    categories = tuple(sorted({pack.category for pack in packs} - {OTHER}))
    clouds, category, samples, period = [], [], [], []
    for shape in sampled_shapes(packs, generator, device, progress):
        clouds.append(shape.cloud.half())
        category.append(category_index(shape.pack.category, _factory(shape.pack, shape.index), categories))
        samples.append(shape.cloud[: 2 * SYMMETRY_POINTS])
        if len(samples) == AT_ONCE:
            period.append(_periods(samples))
            samples = []
    period += [_periods(samples)] if samples else []
    if len(clouds) < 2 or not categories:
        raise PackError("The mesh packs hold too few shapes to recognize; give packs with splits source and train.")
    kinds = torch.tensor(category, device=device)
    return RecognitionData(
        categories,
        kinds,
        torch.stack(clouds),
        # The yaw of other things is not learned.
        torch.where(kinds < len(categories), torch.cat(period), 0.0),
    )


def category_index(category: str, name: str, known: Sequence[str]) -> int:
    """Return the index of the category of a shape or thing among the known ones; their number for other things.

    Args:
        category: of its pack or of its room's list; name: of its family or of the thing.
    """
    own = CATEGORY_OF_NAME.get(name, name) if category == OTHER or name in SOFAS else category
    return known.index(own) if own in known else len(known)


def _factory(pack: MeshPack, index: int) -> str:
    return str(pack.extra["factory"][index]) if "factory" in pack.extra else ""


def _periods(samples: Sequence[Tensor]) -> Tensor:
    return yaw_periods(*torch.stack(list(samples)).chunk(2, dim=1))


def yaw_periods(
    clouds: Float[Tensor, "batch points 3"], again: Float[Tensor, "batch points 3"]
) -> Float[Tensor, " batch"]:
    """Find the smallest yaws that map shapes onto themselves, of two samples each: 2 pi, pi, pi / 2, 0."""
    middle = (clouds.amin(1, keepdim=True) + clouds.amax(1, keepdim=True)) / 2
    angles = torch.tensor([0.0, math.pi, math.pi / 2, math.pi / 4, math.pi / 6], device=clouds.device)
    rotated = ((again - middle)[:, None] @ yaw_matrices(angles).mT).flatten(0, 1)
    here = (clouds - middle).repeat_interleave(len(angles), 0)
    forth, back = nearest_neighbours(here, rotated)[0], nearest_neighbours(rotated, here)[0]
    ways = torch.cat([forth, back], dim=1).sqrt().view(len(clouds), len(angles), -1)
    distance, stray = ways.mean(2), (ways > STRAY_DISTANCE).float().mean(2)
    same = (distance[:, 1:] - distance[:, :1] < YAW_TOLERANCE) & (stray[:, 1:] - stray[:, :1] < STRAY_FRACTION)
    half, quarter, eighth, twelfth = same.unbind(1)
    period = torch.where(half, math.pi, torch.full_like(distance[:, 0], 2 * math.pi))
    period = torch.where(half & quarter, math.pi / 2, period)
    return torch.where(quarter & eighth & twelfth, 0.0, period)
