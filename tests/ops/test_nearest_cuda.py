"""The fused kernel finds what the plain path finds; runs where there are CUDA and Triton."""

import pytest
import torch

from kpred.ops.nearest import nearest_neighbours, nearest_reference

pytest.importorskip("triton")
nearest_cuda = pytest.importorskip("kpred.ops.nearest_cuda").nearest_cuda
if not torch.cuda.is_available():
    pytest.skip("no CUDA device", allow_module_level=True)


def _clouds(*shapes: tuple[int, int]) -> list[torch.Tensor]:
    generator = torch.Generator(device="cuda").manual_seed(0)
    return [torch.randn(*shape, 3, generator=generator, device="cuda") for shape in shapes]


@pytest.mark.parametrize(
    ("batch", "n", "m"), [(1, 1, 1), (2, 100, 77), (3, 64, 32), (2, 130, 257), (16, 2048, 2048), (1, 5, 1)]
)
def test_kernel_and_plain_path_agree(batch: int, n: int, m: int) -> None:
    query, reference = _clouds((batch, n), (batch, m))
    distance, index = nearest_cuda(query, reference)
    plain, _ = nearest_reference(query, reference)
    torch.testing.assert_close(distance, plain, rtol=1e-5, atol=1e-12)
    there = torch.gather(reference, 1, index[..., None].expand(-1, -1, 3))
    torch.testing.assert_close((query - there).square().sum(-1), plain, rtol=1e-5, atol=1e-12)


def test_clouds_may_be_expanded_strided_and_alike() -> None:
    one, many = _clouds((1, 70), (4, 90))
    for query, reference in (
        (one.expand(4, -1, -1), many),
        (many, one.expand(4, -1, -1)),
        (many[:, ::2], many.flip(1)),
    ):
        distance, index = nearest_neighbours(query, reference)
        plain, plain_index = nearest_reference(query.contiguous(), reference.contiguous())
        torch.testing.assert_close(distance, plain, rtol=1e-5, atol=1e-12)
        assert (index == plain_index).float().mean() > 0.99


def test_ties_go_to_the_lower_index() -> None:
    query = torch.zeros(1, 3, 3, device="cuda")
    reference = torch.ones(1, 200, 3, device="cuda")
    assert nearest_cuda(query, reference)[1].tolist() == [[0, 0, 0]]
