"""How training clouds are varied: shares that are hidden, factors, turns, what a camera cannot see."""

import math

import numpy as np
import torch

from kpred.ops import sample_surface
from kpred.ops.rotations import yaw_rotation
from kpred.training.augmentation import (
    box_of,
    disturbed,
    random_factors,
    random_slices,
    random_views,
    to_unit_box,
    yaw_matrices,
)


def test_factors_stay_within_the_stretch_and_mirror_only_left_to_right(generator: torch.Generator) -> None:
    factors = random_factors(200, 1.3, generator)
    assert (factors.abs() <= 1.3).all() and (factors.abs() >= 1 / 1.3).all()
    assert (factors[:, :, 1:] > 0).all()
    assert 0.3 < (factors[:, :, 0] < 0).float().mean() < 0.7


def test_clouds_fill_their_unit_box(generator: torch.Generator) -> None:
    clouds = torch.rand(4, 100, 3, generator=generator) * torch.tensor([1.0, 5.0, 2.0]) + 7.0
    boxed = to_unit_box(clouds)
    middle, half = box_of(boxed)
    assert torch.allclose(boxed.abs().amax((1, 2)), torch.ones(4), atol=1e-5)
    assert middle.abs().max() < 1e-5 and torch.allclose(half, torch.ones(4, 1, 1), atol=1e-5)


def test_slices_hide_the_share_that_was_asked_for(generator: torch.Generator) -> None:
    clouds = torch.rand(8, 400, 3, generator=generator)
    left = random_slices(clouds, (0.5, 0.5), generator)
    for whole, part in zip(clouds, left, strict=True):
        rows = {tuple(point) for point in part.tolist()}
        assert rows <= {tuple(point) for point in whole.tolist()}
        assert len(rows) == 200


def test_disturbance_is_bounded_by_what_was_asked_for(generator: torch.Generator) -> None:
    clouds = torch.rand(6, 500, 3, generator=generator)
    assert torch.equal(disturbed(clouds, 0.0, 0.0, generator), clouds)
    moved = (disturbed(clouds, 0.0, 0.2, generator) - clouds).abs().amax(2) > 0
    assert 0 < moved.float().mean() < 0.2
    assert (disturbed(clouds, 0.01, 0.0, generator) - clouds).std() < 0.01


def test_turns_are_those_of_the_fit() -> None:
    angles = torch.tensor([0.0, 0.3, -2.0, math.pi])
    for angle, matrix in zip(angles.tolist(), yaw_matrices(angles), strict=True):
        assert np.allclose(matrix.numpy(), yaw_rotation(angle), atol=1e-6)


def test_a_camera_from_above_sees_little_of_the_underside(generator: torch.Generator) -> None:
    corners = torch.tensor([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
    box = torch.tensor(
        [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4],
         [1, 5, 7], [1, 7, 3]]
    )  # fmt: skip
    clouds = torch.stack([sample_surface(corners, box, 16384, generator)[0] for _ in range(6)])
    scans = random_views(clouds, 300, generator)
    assert scans.shape == (6, 300, 3) and scans.abs().max() < 1.05
    top, bottom = (scans[..., 1] > 0.97).float().mean(), (scans[..., 1] < -0.97).float().mean()
    assert top > 0.1 > bottom
    for scan in scans:
        sides = [(scan[:, axis] * way > 0.97).float().mean() > 0.1 for axis in (0, 2) for way in (-1, 1)]
        assert sum(sides) <= 2, "more sides than one camera can see"
