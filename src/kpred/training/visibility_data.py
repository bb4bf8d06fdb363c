"""Training data of the visibility network: dense clouds of whole surfaces, of all categories."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from kpred.errors import MeshError, PackError, ScanError
from kpred.ops import sample_surface, unit_box_frame
from kpred.ops.typing import Float, Int
from kpred.shapes.mesh import Mesh
from kpred.shapes.pack import MeshPack
from kpred.training.data import POOL_POINTS, Progress


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
    total, done = sum(len(pack) for pack in packs), 0
    for pack in packs:
        for index in range(len(pack)):
            done += 1
            if progress:
                progress("scanning shapes", done, total)
            if str(pack.split[index]) not in ("source", "train"):
                continue
            try:
                cloud = dense_cloud(pack[index], POOL_POINTS, generator, device)
            except (ScanError, MeshError):
                continue
            found[pack.category].append(cloud.half())
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


def dense_cloud(
    mesh: Mesh, count: int, generator: torch.Generator, device: torch.device | str = "cpu"
) -> Float[Tensor, "count 3"]:
    """Sample points (unit box) of a mesh's whole surface, inner faces included, in random order.

    Raises:
        ScanError, MeshError: if the mesh has no extent or no area.
    """
    frame = unit_box_frame(mesh.vertices)
    corners = torch.from_numpy(frame.to_unit(mesh.vertices)).float().to(device)
    faces = torch.from_numpy(mesh.faces).long().to(device)
    return sample_surface(corners, faces, count, generator)[0]
