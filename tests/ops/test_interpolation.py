"""Interpolated influence: affine precision, sums of one, and keypoints in degenerate places."""

import pytest
import torch

from kpred.ops.interpolation import affine_influence, gaussian_influence


@pytest.fixture
def places(generator: torch.Generator) -> tuple[torch.Tensor, torch.Tensor]:
    options = {"generator": generator, "dtype": torch.float64}
    return 2 * torch.rand(3, 12, 3, **options) - 1, 3 * torch.rand(3, 42, 3, **options) - 1.5


@pytest.mark.parametrize("influence", [affine_influence, gaussian_influence])
def test_columns_sum_to_one(places, influence) -> None:
    weights = influence(*places)
    assert weights.shape == (3, 12, 42)
    torch.testing.assert_close(weights.sum(1), torch.ones(3, 42, dtype=torch.float64), rtol=0, atol=1e-9)
    # Hence keypoints moved by one vector move everything by that vector.
    shift = torch.tensor([0.3, -2.0, 0.7], dtype=torch.float64)
    moved = weights.transpose(1, 2) @ shift.expand(3, 12, 3)
    torch.testing.assert_close(moved, shift.expand(3, 42, 3), rtol=0, atol=1e-9)


@pytest.mark.parametrize(("ridge", "tolerance"), [(1e-12, 1e-8), (1e-3, 1e-2)])
@pytest.mark.parametrize("smoothing", [0.0, 0.01, 0.2])
def test_affine_maps_are_reproduced(places, generator, smoothing: float, ridge: float, tolerance: float) -> None:
    keypoints, positions = places
    matrix = torch.randn(3, 3, generator=generator, dtype=torch.float64)
    weights = affine_influence(keypoints, positions, smoothing, ridge)
    moved = weights.transpose(1, 2) @ (keypoints @ matrix)
    assert (moved - positions @ matrix).abs().max() < tolerance


def test_without_smoothing_keypoints_are_interpolated(places) -> None:
    keypoints, _ = places
    weights = affine_influence(keypoints, keypoints, smoothing=0.0)
    identity = torch.eye(12, dtype=torch.float64).expand(3, -1, -1)
    torch.testing.assert_close(weights, identity, rtol=0, atol=1e-8)
    smoothed = affine_influence(keypoints, keypoints, smoothing=0.2)
    assert (smoothed - identity).abs().max() > 1e-3


@pytest.mark.parametrize("axes", [(2,), (1, 2), (0, 1, 2)], ids=["coplanar", "collinear", "coincident"])
def test_degenerate_keypoints_stay_finite(places, axes: tuple[int, ...]) -> None:
    keypoints, positions = places[0].float(), places[1].float()
    keypoints[..., list(axes)] = 0.25
    keypoints.requires_grad_()
    weights = affine_influence(keypoints, positions)
    weights.square().sum().backward()
    assert torch.isfinite(weights).all()
    assert keypoints.grad is not None and torch.isfinite(keypoints.grad).all()
    torch.testing.assert_close(weights.sum(1), torch.ones(3, 42), rtol=0, atol=1e-3)
    if axes == (2,):
        # Maps within the plane are still reproduced where the plane is.
        flat = positions.clone()
        flat[..., 2] = 0.25
        moved = affine_influence(keypoints, flat).transpose(1, 2) @ keypoints
        assert (moved - flat).abs().max() < 1e-2


def test_affine_influence_is_differentiable(places) -> None:
    keypoints, positions = places[0][:1, :5].requires_grad_(), places[1][:1, :4].requires_grad_()
    assert torch.autograd.gradcheck(affine_influence, (keypoints, positions))


def test_affine_influence_turns_with_the_shape(places) -> None:
    keypoints, positions = places
    turn, _ = torch.linalg.qr(torch.randn(3, 3, generator=torch.Generator().manual_seed(3), dtype=torch.float64))
    torch.testing.assert_close(
        affine_influence(keypoints @ turn, positions @ turn), affine_influence(keypoints, positions), rtol=0, atol=1e-9
    )


def test_gaussian_influence(places) -> None:
    keypoints, positions = places
    squared = torch.cdist(keypoints, positions).square()
    slow = torch.exp(-squared / (2 * 0.5**2))
    torch.testing.assert_close(gaussian_influence(keypoints, positions), slow / slow.sum(1, keepdim=True))
    # A narrow bell leaves each position to its nearest keypoint.
    narrow = gaussian_influence(keypoints, positions, width=1e-3)
    assert torch.equal(narrow.argmax(1), squared.argmin(1))
    assert narrow.amax(1).min() > 0.99
