"""Chamfer distances: value and gradient against the full distance matrix, and their laws."""

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from kpred.ops.chamfer import chamfer_distance, squared_distances, unilateral_chamfer_distance


def _full(target: torch.Tensor, result: torch.Tensor, both: bool) -> torch.Tensor:
    matrix = ((target[:, :, None] - result[:, None]) ** 2).sum(-1)
    forth = matrix.amin(2).mean(1)
    return forth + matrix.amin(1).mean(1) if both else forth


def _clouds(seed: int, batch: int = 2, n: int = 40, m: int = 25, dtype: torch.dtype = torch.float64):
    generator = torch.Generator().manual_seed(seed)
    return tuple(torch.randn(batch, k, 3, generator=generator, dtype=dtype) for k in (n, m))


@pytest.mark.parametrize(
    ("distance", "both"), [(chamfer_distance, True), (unilateral_chamfer_distance, False)], ids=["CD", "UCD"]
)
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_value_and_gradient_of_the_full_matrix(distance, both: bool, dtype: torch.dtype) -> None:
    clouds = _clouds(1, dtype=dtype)
    ours, slow = [[c.clone().requires_grad_() for c in clouds] for _ in range(2)]
    weight = torch.tensor([1.0, -2.0], dtype=dtype)
    a, b = distance(*ours), _full(*slow, both)
    tolerance = 1e-5 if dtype == torch.float32 else 1e-12
    torch.testing.assert_close(a, b, rtol=tolerance, atol=tolerance)
    (a * weight).sum().backward()
    (b * weight).sum().backward()
    for mine, theirs in zip(ours, slow, strict=True):
        torch.testing.assert_close(mine.grad, theirs.grad, rtol=tolerance, atol=tolerance)
    torch.testing.assert_close(distance(*clouds), a.detach(), rtol=tolerance, atol=tolerance)


def test_gradcheck_in_double() -> None:
    target, result = (c.requires_grad_() for c in _clouds(2, 1, 7, 5))
    assert torch.autograd.gradcheck(chamfer_distance, (target, result))
    assert torch.autograd.gradcheck(unilateral_chamfer_distance, (target, result))


def test_gradient_reaches_the_one_cloud_that_asks_for_it() -> None:
    target, result = _clouds(3)
    result.requires_grad_()
    chamfer_distance(target, result).sum().backward()
    assert target.grad is None
    assert result.grad is not None and (result.grad.abs().sum(-1) > 0).all()
    with torch.no_grad():
        assert not squared_distances(target, result).requires_grad


@given(seed=st.integers(0, 9999), n=st.integers(1, 40), m=st.integers(1, 40), scale=st.floats(0.1, 10))
def test_laws(seed: int, n: int, m: int, scale: float) -> None:
    a, b = _clouds(seed, 1, n, m)
    value = chamfer_distance(a, b)
    torch.testing.assert_close(value, chamfer_distance(b, a))
    assert chamfer_distance(a, a).item() == 0
    assert unilateral_chamfer_distance(a, torch.cat([b, a], 1)).item() == 0
    generator = torch.Generator().manual_seed(seed)
    shuffled = [c[:, torch.randperm(c.shape[1], generator=generator)] for c in (a, b)]
    torch.testing.assert_close(value, chamfer_distance(*shuffled))
    both = unilateral_chamfer_distance(a, b) + unilateral_chamfer_distance(b, a)
    torch.testing.assert_close(value, both)
    torch.testing.assert_close(chamfer_distance(scale * a, scale * b), scale**2 * value)
    shift = torch.ones(3, dtype=a.dtype)
    torch.testing.assert_close(chamfer_distance(a + shift, b + shift), value)


def test_it_is_squared_and_both_ways() -> None:
    target = torch.tensor([[[0.0, 0, 0], [4, 0, 0]]])
    result = torch.tensor([[[0.0, 3, 0]]])
    # target to result: (9 + 25) / 2; result to target: 9.
    assert chamfer_distance(target, result).item() == 26
    assert unilateral_chamfer_distance(target, result).item() == 17
