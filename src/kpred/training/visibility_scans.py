"""Scans of dense clouds with known visibility: whole, cut by a plane, one depth view, or several merged."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from kpred.ops.cloud_depth import CloudDepth, render_depth
from kpred.ops.occlusion import random_directions
from kpred.ops.typing import Bool, Float, Int
from kpred.training.augmentation import RESOLUTION, box_of, disturbed
from kpred.training.visibility_config import VisibilityTraining

KINDS = ("whole", "sliced", "one view", "merged views", "crop")
"""Names of the kinds of scans, in the order of their indices; a crop is cut from a scanned room."""

WAVE_NUMBER = 3.0
"""Standard deviation of the wave numbers (radians per unit) of an uneven density."""


@dataclass(frozen=True, eq=False)
class Visible:
    """What scanners see: of points that scans may be sampled from, and of places."""

    candidates: Bool[Tensor, "batch candidates"]
    places: Bool[Tensor, "batch places"]


def draw_kinds(config: VisibilityTraining, count: int, generator: torch.Generator) -> Int[Tensor, " count"]:
    """Draw indices into `KINDS` by the fractions of `config`."""
    bounds = torch.tensor([config.whole, config.sliced, config.viewed], device=generator.device).cumsum(0)
    return torch.bucketize(torch.rand(count, generator=generator, device=generator.device), bounds, right=True)


def draw_visible(
    dense: Float[Tensor, "batch points 3"],
    candidates: Float[Tensor, "batch candidates 3"],
    places: Float[Tensor, "batch places 3"],
    kind: Int[Tensor, " batch"],
    config: VisibilityTraining,
    generator: torch.Generator,
) -> Visible:
    """Draw scanners of dense clouds and report which surface points and places (unit of the clouds) they see.

    `candidates` are points of the same surfaces, fewer than the dense clouds need to hide what is behind them.
    """
    points = torch.ones(candidates.shape[:2], dtype=torch.bool, device=dense.device)
    seen = torch.ones(places.shape[:2], dtype=torch.bool, device=dense.device)
    sliced = (kind == 1).nonzero()[:, 0]
    if len(sliced):
        points[sliced], seen[sliced] = _sliced(candidates[sliced], places[sliced], config.hidden, generator)
    viewed = (kind >= 2).nonzero()[:, 0]
    if len(viewed):
        several = torch.randint(2, config.max_views + 1, (len(viewed),), generator=generator, device=dense.device)
        views = torch.where(kind[viewed] == 2, 1, several)
        images, owner = _draw_views(dense[viewed], views, generator)
        for found, queried, tolerance in ((points, candidates, 0.0), (seen, places, config.tolerance)):
            by_view = images.sees(queried[viewed][owner], tolerance)
            count = torch.zeros(len(viewed), by_view.shape[1], device=dense.device)
            found[viewed] = count.index_add_(0, owner, by_view.float()) > 0
    return Visible(points, seen)


def _sliced(
    points: Tensor, places: Tensor, hidden: tuple[float, float], generator: torch.Generator
) -> tuple[Tensor, Tensor]:
    """Cut each cloud and the space around it by a random plane."""
    ratio = hidden[0] + (hidden[1] - hidden[0]) * torch.rand(len(points), generator=generator, device=points.device)
    normal = random_directions(len(points), generator, points.device)[:, :, None]
    height = (points @ normal)[..., 0]
    rank = ((1 - ratio) * (points.shape[1] - 1)).long()
    level = torch.gather(height.sort(dim=1).values, 1, rank[:, None])
    return height <= level, (places @ normal)[..., 0] <= level


def _draw_views(dense: Tensor, views: Tensor, generator: torch.Generator) -> tuple[CloudDepth, Tensor]:
    """Render depth images of `views` (batch,) random cameras of each cloud, and their cloud indices."""
    owner = torch.arange(len(dense), device=dense.device).repeat_interleave(views)
    middle, half = box_of(dense)
    cameras = middle[owner, 0] + half[owner, 0] * random_cameras(views, generator)
    return render_depth(dense[owner], cameras, RESOLUTION), owner


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
    candidates: Float[Tensor, "batch candidates 3"],
    visible: Bool[Tensor, "batch candidates"],
    count: int,
    config: VisibilityTraining,
    generator: torch.Generator,
) -> Float[Tensor, "batch count 3"]:
    """Sample visible candidates (unit box) unevenly, with noise and strays; they repeat if few are seen."""
    options: dict[str, Any] = {"generator": generator, "device": candidates.device}
    wave = WAVE_NUMBER * torch.randn(len(candidates), 3, 1, **options)
    phase, amplitude = torch.rand(2, len(candidates), 1, **options)
    density = config.density * amplitude * torch.sin((candidates @ wave)[..., 0] + 2 * math.pi * phase)
    # The largest sums of logarithmic weight and Gumbel noise are a weighted sample without repeats.
    gumbel = -torch.empty(candidates.shape[:2], device=candidates.device).exponential_(generator=generator).log()
    order = torch.where(visible, density + gumbel, -torch.inf).topk(count, dim=1).indices
    slot = torch.arange(count, device=candidates.device)[None] % visible.sum(1, keepdim=True).clamp(min=1)
    index = torch.gather(order, 1, slot)
    cloud = torch.gather(candidates, 1, index[..., None].expand(-1, -1, 3))
    return disturbed(cloud, config.noise, config.outliers, generator)
