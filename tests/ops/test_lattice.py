"""The lattice's weights are a partition of unity with linear precision; its stiffness leaves affine maps alone."""

import pytest
import torch

from kpred.ops.lattice import SIZE, lattice_asymmetry, lattice_stiffness, lattice_weights

LOW, HIGH = torch.tensor([-1.0, -0.4, -0.7]), torch.tensor([1.0, 0.4, 0.7])


def _controls() -> torch.Tensor:
    """Places (controls, 3) of the control points: those of the spline's knot averages (Greville)."""
    place = (torch.arange(SIZE) - 0.5) / (SIZE - 2)
    grid = torch.stack(torch.meshgrid(place, place, place, indexing="ij"), dim=-1).reshape(-1, 3)
    return LOW + grid * (HIGH - LOW)


@pytest.fixture
def points() -> torch.Tensor:
    inside = torch.rand(200, 3, generator=torch.Generator().manual_seed(0))
    # A little beyond the box too.
    return LOW + (1.1 * inside - 0.05) * (HIGH - LOW)


def test_weights_sum_to_one_and_reproduce_the_points(points: torch.Tensor) -> None:
    weights = lattice_weights(points, LOW, HIGH)
    assert weights.shape == (200, SIZE**3)
    assert torch.allclose(weights.sum(1), torch.ones(200), atol=1e-5)
    assert torch.allclose(weights @ _controls(), points, atol=1e-5)


def test_weights_are_smooth_and_local(points: torch.Tensor) -> None:
    weights = lattice_weights(points, LOW, HIGH)
    near = lattice_weights(points + 1e-4, LOW, HIGH)
    assert (weights - near).abs().max() < 2e-3
    assert ((weights != 0).sum(1) <= 27).all()


def test_a_box_without_thickness_has_weights(points: torch.Tensor) -> None:
    flat = points * torch.tensor([1.0, 0.0, 1.0])
    weights = lattice_weights(flat, LOW * torch.tensor([1.0, 0.0, 1.0]), HIGH * torch.tensor([1.0, 0.0, 1.0]))
    assert weights.isfinite().all()
    assert torch.allclose(weights.sum(1), torch.ones(200), atol=1e-5)


def test_affine_maps_cost_nothing_and_bending_costs_more_than_stretching() -> None:
    stiffness = lattice_stiffness()
    at = _controls().double()
    affine = at @ torch.rand(3, 3, generator=torch.Generator().manual_seed(1)).double() + 0.3

    def cost(moved: torch.Tensor) -> float:
        return float(torch.einsum("ia,aij,ja->", moved, stiffness, moved))

    assert cost(affine) < 1e-9
    grown, bent = torch.zeros_like(at), torch.zeros_like(at)
    height = (at[:, 1] / 0.4).clamp(min=0).square()
    grown[:, 1], bent[:, 0] = height, height
    assert 0 < 10 * cost(grown) < cost(bent)


def test_what_is_mirror_symmetric_is_not_asymmetric() -> None:
    at = _controls().double()
    splayed, shoved = torch.zeros_like(at), torch.zeros_like(at)
    splayed[:, 0], splayed[:, 2] = at[:, 0] * at[:, 1], at[:, 0].square()
    shoved[:, 0], shoved[:, 1] = 1.0, at[:, 0]
    form = lattice_asymmetry()
    symmetric, asymmetric = (torch.einsum("ia,aij,ja->a", moved, form, moved) for moved in (splayed, shoved))
    assert symmetric.abs().max() < 1e-9
    assert (asymmetric[:2] > 1).all()
