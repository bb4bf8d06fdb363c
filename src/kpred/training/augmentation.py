"""How training clouds are varied: stretched, mirrored, cut, seen from one side, disturbed as scans are."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar

import torch
from torch import Tensor

from kpred.ops import slice_by_plane
from kpred.ops.occlusion import random_directions, resample_visible, visible_to_camera
from kpred.ops.typing import Float

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")

RESOLUTION = 48
"""Pixels along a side of the depth images that decide what a camera sees: what stands before what, not fine detail."""


def in_full_precision(draw: Callable[Arguments, Result]) -> Callable[Arguments, Result]:
    """Wrap a function to run without autocast, so that clouds are not rounded."""

    @functools.wraps(draw)
    def exact(*args: Arguments.args, **options: Arguments.kwargs) -> Result:
        with torch.autocast("cpu", enabled=False), torch.autocast("cuda", enabled=False):
            return draw(*args, **options)

    return exact


def random_factors(count: int, stretch: float, generator: torch.Generator) -> Float[Tensor, "count 1 3"]:
    """Draw factors per axis, up to `stretch` or down to its inverse; half of the clouds are mirrored."""
    options: dict[str, Any] = {"generator": generator, "device": generator.device}
    factors = stretch ** (2 * torch.rand(count, 1, 3, **options) - 1)
    mirror = 1 - 2 * torch.randint(0, 2, (count, 1, 1), **options).float()
    return factors * torch.cat([mirror, torch.ones_like(mirror), torch.ones_like(mirror)], dim=2)


def box_of(clouds: Float[Tensor, "batch points 3"]) -> tuple[Float[Tensor, "batch 1 3"], Float[Tensor, "batch 1 1"]]:
    """Return the middle of each cloud's box, and half of its longest side."""
    low, high = clouds.amin(1, keepdim=True), clouds.amax(1, keepdim=True)
    return (low + high) / 2, (high - low).amax(2, keepdim=True) / 2


def to_unit_box(clouds: Float[Tensor, "batch points 3"]) -> Float[Tensor, "batch points 3"]:
    """Return centre each cloud on its box and divide it by its largest absolute coordinate."""
    middle, half = box_of(clouds)
    return (clouds - middle) / half


def random_views(
    clouds: Float[Tensor, "batch dense 3"], count: int, generator: torch.Generator
) -> Float[Tensor, "batch count 3"]:
    """Render dense clouds by depth cameras from random sides, slightly below to steeply above.

    Points in random order, repeated where less than `count` are seen; frame and unit of the clouds, y up.
    """
    angle, rise, far = torch.rand(3, len(clouds), generator=generator, device=clouds.device)
    azimuth, elevation, distance = 2 * math.pi * angle, torch.deg2rad(-5 + 60 * rise), 2.5 + 3 * far
    level = distance * elevation.cos()
    place = torch.stack([level * azimuth.sin(), distance * elevation.sin(), level * azimuth.cos()], dim=1)
    middle, half = box_of(clouds)
    visible = visible_to_camera(clouds, middle[:, 0] + half[:, 0] * place, RESOLUTION)
    # As clouds are in random order, any run of visible points is a fair sample, and takes no sorting.
    total = visible.sum(1, keepdim=True).clamp(min=1)
    start = (torch.rand(len(clouds), 1, generator=generator, device=clouds.device) * total).long()
    slot = torch.where(visible, torch.remainder(visible.cumsum(1) - 1 - start, total), count).clamp(max=count)
    index = torch.zeros(len(clouds), count + 1, dtype=torch.long, device=clouds.device)
    index.scatter_(1, slot, torch.arange(clouds.shape[1], device=clouds.device).expand_as(slot))
    index = torch.gather(index, 1, torch.arange(count, device=clouds.device)[None] % total)
    return torch.gather(clouds, 1, index[..., None].expand(-1, -1, 3))


def random_slices(
    clouds: Float[Tensor, "batch points 3"], occlusion: tuple[float, float], generator: torch.Generator
) -> Float[Tensor, "batch points 3"]:
    """Hide a random fraction of each cloud behind a random plane (the paper's slicing); points repeat."""
    low, high = occlusion
    ratio = low + (high - low) * torch.rand(len(clouds), generator=generator, device=clouds.device)
    normal = random_directions(len(clouds), generator, clouds.device)
    visible = slice_by_plane(clouds, ratio, normal)
    index = resample_visible(clouds, visible, clouds.shape[1], generator)
    return torch.gather(clouds, 1, index[..., None].expand(-1, -1, 3))


def disturbed(
    seen: Float[Tensor, "batch points 3"], noise: float, outliers: float, generator: torch.Generator
) -> Float[Tensor, "batch points 3"]:
    """Add jitter, and stray points near the visible part; amounts differ from cloud to cloud.

    `noise` (unit of the clouds) and `outliers` (fraction of the points) are the most that a cloud gets.
    """
    options: dict[str, Any] = {"generator": generator, "device": seen.device}
    level = torch.rand(len(seen), 1, 1, **options)
    seen = seen + noise * level * torch.randn(seen.shape, **options)
    middle, half = box_of(seen)
    stray = middle + half * (2.4 * torch.rand(seen.shape, **options) - 1.2)
    fraction = outliers * torch.rand(len(seen), 1, 1, **options)
    return torch.where(torch.rand(*seen.shape[:2], 1, **options) < fraction, stray, seen)


def yaw_matrices(angle: Float[Tensor, " batch"]) -> Float[Tensor, "batch 3 3"]:
    """Return rotations about +y that take +z towards +x, for column vectors; rows rotate by `cloud @ R^T`."""
    zero, one, c, s = torch.zeros_like(angle), torch.ones_like(angle), angle.cos(), angle.sin()
    rows = [torch.stack(row, dim=1) for row in ((c, zero, s), (zero, one, zero), (-s, zero, c))]
    return torch.stack(rows, dim=1)
