"""Training data of the visibility network: dense clouds of whole surfaces, of all categories."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from kpred.errors import PackError
from kpred.ops.typing import Float, Int
from kpred.shapes.pack import MeshPack
from kpred.training.data import Progress
from kpred.training.dense_clouds import sampled_shapes


@dataclass(frozen=True, eq=False)
class VisibilityData:
    """Shapes of several categories.

    Attributes:
        categories: names; `category` holds indices into them, in rising order.
        clouds: dense whole surfaces, points in random order, in each shape's unit box; half precision.
    """

    categories: tuple[str, ...]
    category: Int[Tensor, " shapes"]
    clouds: Float[Tensor, "shapes points 3"]

    def draw(self, count: int, generator: torch.Generator) -> tuple[Int[Tensor, " count"], Int[Tensor, " count"]]:
        """Draw indices of shapes, categories equally often, and for each of another shape of its category."""
        number = torch.bincount(self.category, minlength=len(self.categories))
        first = number.cumsum(0) - number
        chosen = torch.randint(0, len(number), (count,), generator=generator, device=number.device)
        one, other = torch.rand(2, count, generator=generator, device=number.device)
        row = (one * number[chosen]).long()
        # A step of 1 to number - 1 leads to any shape but itself.
        step = 1 + (other * (number[chosen] - 1)).long()
        return first[chosen] + row, first[chosen] + (row + step) % number[chosen]


def prepare_visibility(
    packs: Sequence[MeshPack],
    seed: int,
    device: torch.device | str = "cpu",
    progress: Progress | None = None,
) -> VisibilityData:
    """Sample surfaces (unit box) of the splits `source` and `train` of all packs.

    Raises:
        PackError: if a category has fewer than two usable shapes.
    """
    generator = torch.Generator(device=device).manual_seed(seed)
    found: dict[str, list[Tensor]] = {pack.category: [] for pack in packs}
    for shape in sampled_shapes(packs, generator, device, progress):
        found[shape.pack.category].append(shape.cloud.half())
    few = sorted(name for name, clouds in found.items() if len(clouds) < 2)
    if few or not found:
        raise PackError(f"Too few shapes ({', '.join(few) or 'no pack'}); give two or more a category to train with.")
    categories = tuple(sorted(found))
    numbers = torch.tensor([len(found[name]) for name in categories], device=device)
    return VisibilityData(
        categories,
        torch.arange(len(categories), device=device).repeat_interleave(numbers),
        torch.stack([cloud for name in categories for cloud in found[name]]),
    )
