"""Scans of dense clouds with known visibility: whole, cut by a plane, seen in one depth view or merged of several."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from kpred.ops.cloud_depth import render_depth
from kpred.ops.occlusion import random_directions
from kpred.ops.typing import Bool, Float, Int
from kpred.training.augmentation import RESOLUTION, box_of, disturbed
from kpred.training.visibility_config import VisibilityTraining

KINDS = ("whole", "sliced", "one view", "merged views")
"""Names of the kinds of scans, in the order of their indices."""

WAVE_NUMBER = 3.0
"""Standard deviation of the wave numbers (radians per unit) of an uneven density."""


@dataclass(frozen=True, eq=False)
class Visible:
    """What scanners of the kinds `kind` see: points of the dense clouds, and places, in these clouds' frames."""

    points: Bool[Tensor, "batch points"]
    places: Bool[Tensor, "batch places"]


def draw_kinds(config: VisibilityTraining, count: int, generator: torch.Generator) -> Int[Tensor, " count"]:
    """Draw indices into `KINDS` by the fractions of `config`."""
    bounds = torch.tensor([config.whole, config.sliced, config.viewed], device=generator.device).cumsum(0)
    return torch.bucketize(torch.rand(count, generator=generator, device=generator.device), bounds, right=True)


def draw_visible(
    dense: Float[Tensor, "batch points 3"],
    places: Float[Tensor, "batch places 3"],
    kind: Int[Tensor, " batch"],
    config: VisibilityTraining,
    generator: torch.Generator,
) -> Visible:
    """Draw scanners of dense clouds and report which points and places (unit of the clouds) they see."""
    points = torch.ones(dense.shape[:2], dtype=torch.bool, device=dense.device)
    seen = torch.ones(places.shape[:2], dtype=torch.bool, device=dense.device)
    sliced = (kind == 1).nonzero()[:, 0]
    if len(sliced):
        points[sliced], seen[sliced] = _sliced(dense[sliced], places[sliced], config.hidden, generator)
    viewed = (kind >= 2).nonzero()[:, 0]
    if len(viewed):
        several = torch.randint(2, config.max_views + 1, (len(viewed),), generator=generator, device=dense.device)
        views = torch.where(kind[viewed] == 2, 1, several)
        points[viewed], seen[viewed] = _viewed(dense[viewed], places[viewed], views, config.tolerance, generator)
    return Visible(points, seen)


def _sliced(
    dense: Tensor, places: Tensor, hidden: tuple[float, float], generator: torch.Generator
) -> tuple[Tensor, Tensor]:
    ratio = hidden[0] + (hidden[1] - hidden[0]) * torch.rand(len(dense), generator=generator, device=dense.device)
    normal = random_directions(len(dense), generator, dense.device)[:, :, None]
    height = (dense @ normal)[..., 0]
    rank = ((1 - ratio) * (dense.shape[1] - 1)).long()
    level = torch.gather(height.sort(dim=1).values, 1, rank[:, None])
    return height <= level, (places @ normal)[..., 0] <= level


def _viewed(
    dense: Tensor, places: Tensor, views: Tensor, tolerance: float, generator: torch.Generator
) -> tuple[Tensor, Tensor]:
    """What any of `views` (batch,) cameras sees of each cloud."""
    owner = torch.arange(len(dense), device=dense.device).repeat_interleave(views)
    middle, half = box_of(dense)
    cameras = random_cameras(views, generator)
    clouds = dense[owner]
    images = render_depth(clouds, middle[owner, 0] + half[owner, 0] * cameras, RESOLUTION)
    found = []
    for seen in (images.sees(clouds), images.sees(places[owner], tolerance)):
        count = torch.zeros(len(dense), seen.shape[1], device=dense.device)
        found.append(count.index_add_(0, owner, seen.float()) > 0)
    return found[0], found[1]


def random_cameras(views: Int[Tensor, " batch"], generator: torch.Generator) -> Float[Tensor, "views 3"]:
    """Draw camera positions around an object at the origin (half extents), `views` for each of a batch, in its order.

    Heights reach from a little below the middle to steeply above; the cameras of one object are on an arc about y.
    """
    options: dict[str, Any] = {"generator": generator, "device": views.device}
    owner = torch.arange(len(views), device=views.device).repeat_interleave(views)
    start, arc = 2 * math.pi * torch.rand(2, len(views), **options)
    along, rise, far = torch.rand(3, len(owner), **options)
    azimuth, elevation, distance = start[owner] + arc[owner] * along, torch.deg2rad(-5 + 60 * rise), 2.5 + 3 * far
    level = distance * elevation.cos()
    return torch.stack([level * azimuth.sin(), distance * elevation.sin(), level * azimuth.cos()], dim=1)


def sample_scans(
    dense: Float[Tensor, "batch points 3"],
    visible: Bool[Tensor, "batch points"],
    count: int,
    config: VisibilityTraining,
    generator: torch.Generator,
) -> Float[Tensor, "batch count 3"]:
    """Sample visible points (unit of the clouds) unevenly, with noise and strays; they repeat if few are seen."""
    options: dict[str, Any] = {"generator": generator, "device": dense.device}
    wave = WAVE_NUMBER * torch.randn(len(dense), 3, 1, **options)
    phase, amplitude = torch.rand(2, len(dense), 1, **options)
    density = config.density * amplitude * torch.sin((dense @ wave)[..., 0] + 2 * math.pi * phase)
    # The largest sums of logarithmic weight and Gumbel noise are a weighted sample without repeats.
    gumbel = -torch.empty(dense.shape[:2], device=dense.device).exponential_(generator=generator).log()
    order = torch.where(visible, density + gumbel, -torch.inf).topk(count, dim=1).indices
    slot = torch.arange(count, device=dense.device)[None] % visible.sum(1, keepdim=True).clamp(min=1)
    index = torch.gather(order, 1, slot)
    cloud = torch.gather(dense, 1, index[..., None].expand(-1, -1, 3))
    return disturbed(cloud, config.noise, config.outliers, generator)
