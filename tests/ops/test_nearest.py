"""Nearest neighbours: the compiled kernel, plain torch and a KD-tree say the same."""

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from kpred.ops.nearest import nearest_neighbours, nearest_reference
from kpred.ops.nearest_cpu import LANES, nearest_cpu


def _clouds(seed: int, batch: int, n: int, m: int, spread: float = 1.0) -> tuple[torch.Tensor, torch.Tensor]:
    generator = torch.Generator().manual_seed(seed)
    return tuple(spread * torch.randn(batch, k, 3, generator=generator) for k in (n, m))


@given(
    seed=st.integers(0, 9999),
    batch=st.integers(1, 3),
    n=st.integers(1, 2 * LANES + 3),
    m=st.integers(1, 90),
    spread=st.sampled_from([1e-3, 1.0, 1e3]),
)
def test_kernel_torch_and_tree_agree(seed: int, batch: int, n: int, m: int, spread: float) -> None:
    query, reference = _clouds(seed, batch, n, m, spread)
    distance, index = nearest_cpu(query.numpy(), reference.numpy())
    plain, plain_index = nearest_reference(query, reference)
    np.testing.assert_allclose(distance, plain.numpy(), rtol=1e-5)
    for b in range(batch):
        tree, tree_index = cKDTree(reference[b].double().numpy()).query(query[b].double().numpy())
        np.testing.assert_allclose(distance[b], tree**2, rtol=1e-5, atol=1e-12 * spread**2)
        for found in (index[b], plain_index[b].numpy()):
            gap = np.linalg.norm(query[b].double().numpy() - reference[b].double().numpy()[found], axis=1)
            np.testing.assert_allclose(gap, tree, rtol=1e-5)
            # An index may only differ where another neighbour is as near within single precision.
            second = cKDTree(reference[b].double().numpy()).query(query[b].double().numpy(), k=2)[0][:, 1]
            assert (found == tree_index)[second > tree * (1 + 1e-4)].all()


@pytest.mark.parametrize("search", [nearest_neighbours, nearest_reference])
def test_ties_go_to_the_lower_index(search) -> None:
    query = torch.tensor([[[0.0, 0, 0], [1, 1, 1], [5, 5, 5]]])
    reference = torch.tensor([[[1.0, 0, 0], [0, 1, 0], [1, 1, 1], [1, 1, 1], [-1, 0, 0]]])
    distance, index = search(query, reference)
    assert index.tolist() == [[0, 2, 2]]
    assert distance.tolist() == [[1, 0, 48]]


def test_near_neighbours_keep_their_digits() -> None:
    """|a|^2 - 2ab + |b|^2 would give 0 or noise here."""
    reference = torch.tensor([[[1.0, 1.0, 1.0], [0.0, 0.0, 0.0]]])
    query = reference[:, :1] + torch.tensor([2.0**-14, 0.0, 0.0])
    assert nearest_neighbours(query, reference)[0].item() == 2.0**-28
    assert nearest_reference(query, reference)[0].item() == 2.0**-28


@pytest.mark.parametrize("elements", [1, 100, 777])
def test_chunking_does_not_change_the_result(elements: int) -> None:
    query, reference = _clouds(5, 2, 70, 33)
    whole = nearest_reference(query, reference)
    parts = nearest_reference(query, reference, elements)
    assert torch.equal(whole[0], parts[0])
    assert torch.equal(whole[1], parts[1])


def test_double_precision_is_kept_and_nothing_is_differentiated() -> None:
    query, reference = (c.double().requires_grad_() for c in _clouds(6, 1, 10, 10))
    distance, index = nearest_neighbours(query, reference)
    assert distance.dtype == torch.float64
    assert not distance.requires_grad
    slow = ((query[:, :, None] - reference[:, None]) ** 2).sum(-1)
    np.testing.assert_allclose(distance, slow.amin(2).detach(), rtol=1e-14)
    assert torch.equal(index, slow.argmin(2))


def test_strided_input_is_read_rightly() -> None:
    query, reference = _clouds(7, 2, 40, 30)
    expected = nearest_reference(query[:, ::2].contiguous(), reference.flip(1).contiguous())
    found = nearest_neighbours(query[:, ::2], reference.flip(1))
    np.testing.assert_allclose(found[0], expected[0], rtol=1e-6)
    assert torch.equal(found[1], expected[1])


def test_half_precision_is_compared_in_single(generator: torch.Generator) -> None:
    query, reference = torch.rand(2, 40, 3, generator=generator), torch.rand(2, 50, 3, generator=generator)
    for kind in (torch.bfloat16, torch.float16):
        rough = reference.to(kind)
        distance, index = nearest_neighbours(query, rough)
        wanted = nearest_reference(query, rough.float())
        assert distance.dtype == torch.float32
        torch.testing.assert_close(distance, wanted[0])
        assert torch.equal(index, wanted[1])
