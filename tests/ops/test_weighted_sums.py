"""Sums of least squares: compiled and plain torch agree, and both are what they are said to be."""

import pytest
import torch
from torch import Tensor

from kpred.ops import weighted_sums
from kpred.ops.weighted_sums import add_wanted, deformed, robust_scale, robust_weights, weighted_products

BATCH, POINTS, WANTED, COLUMNS = 3, 97, 50, 12


@pytest.fixture(params=["compiled", "plain"])
def path(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    if request.param == "plain":
        monkeypatch.setattr(weighted_sums, "compiled", None)
    return str(request.param)


@pytest.fixture
def clouds(generator: torch.Generator) -> dict[str, Tensor]:
    return {
        "squared": torch.rand(BATCH, POINTS, generator=generator),
        "places": torch.randn(BATCH, WANTED, 3, generator=generator),
        "weight": torch.rand(BATCH, WANTED, generator=generator),
        "index": torch.randint(0, POINTS, (BATCH, WANTED), generator=generator),
        "across": torch.randn(BATCH, COLUMNS, POINTS, generator=generator),
        "guess": torch.randn(BATCH, POINTS, 3, generator=generator),
        "sums": torch.rand(BATCH, POINTS, 4, generator=generator),
    }


@pytest.mark.parametrize("points", [1, 2, 96, 97])
def test_weights_fall_with_distance_from_one_by_the_median(path: str, clouds: dict[str, Tensor], points: int) -> None:
    squared = clouds["squared"][:, :points]
    weight = robust_weights(squared, 3.0)
    middle = squared.sort(dim=1).values[:, (points - 1) // 2]
    scale = 9.0 * middle[:, None] + weighted_sums.MIN_SCALE
    assert torch.allclose(robust_scale(squared, 3.0), scale)
    assert torch.allclose(weight, (scale / (scale + squared)) ** 2, atol=1e-6)
    assert torch.equal(robust_weights(squared, 0.0), torch.ones_like(squared))


def test_equal_distances_weigh_the_same(path: str) -> None:
    weight = robust_weights(torch.full((1, 64), 0.25), 1.0)
    assert torch.allclose(weight, torch.full_like(weight, 0.25), atol=1e-3)


@pytest.mark.parametrize("shared", [False, True])
@pytest.mark.parametrize("picked", [False, True])
def test_all_that_is_wanted_of_a_point_adds_up(
    path: str, clouds: dict[str, Tensor], generator: torch.Generator, shared: bool, picked: bool
) -> None:
    places = clouds["places"][:1].expand(BATCH, -1, -1) if shared else clouds["places"]
    rows = torch.randint(0, WANTED, (BATCH, WANTED), generator=generator) if picked else None
    sums = clouds["sums"].clone()
    add_wanted(sums, places, clouds["weight"], clouds["index"], rows)
    expected = clouds["sums"].clone()
    for b in range(BATCH):
        for i in range(WANTED):
            place = places[b, i if rows is None else int(rows[b, i])]
            share = clouds["weight"][b, i]
            expected[b, clouds["index"][b, i]] += torch.cat([place * share, share[None]])
    assert torch.allclose(sums, expected, atol=1e-5)


def test_without_an_index_every_point_is_meant(path: str, clouds: dict[str, Tensor]) -> None:
    sums = torch.zeros(BATCH, WANTED, 4)
    add_wanted(sums, clouds["places"], clouds["weight"])
    assert torch.allclose(sums[..., :3] / sums[..., 3:], clouds["places"], atol=1e-5)
    assert torch.equal(sums[..., 3], clouds["weight"])


def test_products_are_those_of_the_weighted_columns(path: str, clouds: dict[str, Tensor]) -> None:
    found = weighted_products(clouds["across"], clouds["guess"], clouds["sums"])
    columns, weight = clouds["across"].double().transpose(1, 2), clouds["sums"][..., 3].double()
    wanted = clouds["sums"][..., :3].double() / weight[..., None]
    weighted = clouds["across"].double() * weight[:, None]
    assert torch.allclose(found[..., :-3].double(), weighted @ columns, atol=1e-4)
    assert torch.allclose(found[..., -3:].double(), weighted @ (wanted - clouds["guess"].double()), atol=1e-4)


def test_deformed_points_are_moved_through_the_basis(path: str, clouds: dict[str, Tensor]) -> None:
    basis, displacement = clouds["across"].transpose(1, 2), clouds["places"][:, :COLUMNS]
    moved = deformed(clouds["guess"], basis, displacement)
    expected = clouds["guess"].double() + basis.double() @ displacement.double()
    assert torch.allclose(moved.double(), expected, atol=1e-5)
    free = displacement.clone().requires_grad_()
    deformed(clouds["guess"], basis, free).sum().backward()
    assert free.grad is not None and free.grad.abs().max() > 0


def test_double_precision_stays_double(clouds: dict[str, Tensor]) -> None:
    found = weighted_products(*(clouds[name].double() for name in ("across", "guess", "sums")))
    assert found.dtype == torch.float64 and robust_weights(clouds["squared"].double(), 1.0).dtype == torch.float64
