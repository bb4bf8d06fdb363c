"""Influence head: support, modes, and what it is at the start of training."""

import pytest
import torch

from kpred.nn.influence import support
from kpred.ops import affine_influence


@pytest.fixture
def inputs(small, clouds: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    network = small()
    with torch.no_grad():
        return clouds, clouds[:, :12] * 0.9, network.cage(clouds)


def _slow_support(keypoints: torch.Tensor, cage: torch.Tensor, neighbours: int) -> torch.Tensor:
    result = torch.zeros(len(keypoints), keypoints.shape[1], cage.shape[1])
    for b in range(len(keypoints)):
        for k in range(keypoints.shape[1]):
            gaps = [float((keypoints[b, k] - v).double().norm()) for v in cage[b]]
            for v in sorted(range(len(gaps)), key=gaps.__getitem__)[:neighbours]:
                result[b, k, v] = 1
    return result


@pytest.mark.parametrize("neighbours", [1, 5, 42, 100])
def test_support_against_a_slow_loop(inputs, neighbours: int) -> None:
    _, keypoints, cage = inputs
    assert torch.equal(support(keypoints, cage, neighbours), _slow_support(keypoints, cage, neighbours))


@pytest.mark.parametrize("attention", [True, False])
def test_local_influence_is_zero_outside_the_support(small, inputs, attention: bool) -> None:
    network = small(influence="local", influence_neighbours=5, self_attention=attention)
    influence = network.influence(*inputs)
    inside = _slow_support(inputs[1], inputs[2], 5).bool()
    assert (influence[~inside] == 0).all()
    assert (influence[inside] != 0).all()
    assert influence.shape == (3, 12, 42)


def test_affine_influence_is_corrected_within_the_support_alone(small, inputs) -> None:
    network = small(influence="affine", influence_neighbours=7)
    _, keypoints, cage = inputs
    smooth = affine_influence(keypoints, cage)
    correction = network.influence(*inputs) - smooth
    inside = _slow_support(keypoints, cage, 7).bool()
    assert (correction[~inside] == 0).all()
    assert correction[inside].abs().min() > 0


def test_training_starts_from_the_smooth_interpolation(small, inputs) -> None:
    network = small(influence="affine", trained=False)
    torch.testing.assert_close(network.influence(*inputs), affine_influence(inputs[1], inputs[2]), rtol=0, atol=0)
    local = small(influence="local", trained=False)
    assert local.influence(*inputs).abs().max() > 0


def test_the_source_is_not_deformed_toward_itself_and_batches_do_not_mix(small, inputs) -> None:
    network = small()
    together = network.influence(*inputs)
    alone = torch.cat([network.influence(*(x[i : i + 1] for x in inputs)) for i in range(3)])
    torch.testing.assert_close(together, alone, rtol=0, atol=1e-5)
    keypoints = inputs[1]
    assert (together.transpose(1, 2) @ (keypoints - keypoints) == 0).all()
