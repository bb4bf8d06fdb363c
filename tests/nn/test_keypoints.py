"""Keypoint predictors: order of points, batches, and where votes may fall."""

import pytest
import torch

from kpred.nn import KPRed

HEADS = ["regression", "voting"]


@pytest.mark.parametrize("head", HEADS)
def test_order_of_the_points_does_not_matter(small, clouds, generator, head: str) -> None:
    network = small(keypoint_head=head)
    order = torch.randperm(256, generator=generator)
    for predict in (network.keypoints, network.partial_keypoints):
        torch.testing.assert_close(predict(clouds[:, order]), predict(clouds), rtol=0, atol=1e-5)


@pytest.mark.parametrize("head", HEADS)
def test_shapes_of_a_batch_do_not_see_each_other(small, clouds, head: str) -> None:
    network = small(keypoint_head=head)
    together = network.keypoints(clouds)
    alone = torch.cat([network.keypoints(cloud[None]) for cloud in clouds])
    torch.testing.assert_close(together, alone, rtol=0, atol=1e-5)
    assert (together[0] - together[1]).abs().max() > 1e-3, "the keypoints do not depend on the shape"


@pytest.mark.parametrize("head", HEADS)
def test_keypoints_stay_near_the_unit_box(small, clouds, head: str) -> None:
    network = small(keypoint_head=head)
    network.keypoint_predictor.output.bias.data += 50.0
    assert network.keypoints(clouds).max() <= 1.2
    network.keypoint_predictor.output.bias.data -= 100.0
    assert network.keypoints(clouds).min() >= -1.2


def test_the_partial_predictor_has_weights_of_its_own(small, clouds) -> None:
    network = small()
    assert not torch.allclose(network.keypoints(clouds), network.partial_keypoints(clouds), atol=1e-3)


def _silence_offsets(network: KPRed) -> None:
    output = network.keypoint_predictor.output
    output.weight.data[network.config.keypoints :] = 0
    output.bias.data[network.config.keypoints :] = 0


def test_votes_without_opinion_give_the_centroid(small, clouds) -> None:
    network = small()
    output = network.keypoint_predictor.output
    output.weight.data.zero_()
    output.bias.data.zero_()
    centroid = clouds.mean(1, keepdim=True).expand(-1, 12, -1)
    torch.testing.assert_close(network.keypoints(clouds), centroid, rtol=0, atol=1e-6)
    # Moved within the box, the keypoints move along; offsets are added on top.
    shift = torch.tensor([0.1, -0.05, 0.2])
    torch.testing.assert_close(network.keypoints(clouds + shift), centroid + shift, rtol=0, atol=1e-6)
    output.bias.data[12:] = torch.arange(36) * 0.01
    wanted = centroid + (torch.arange(36) * 0.01).view(12, 3)
    torch.testing.assert_close(network.keypoints(clouds), wanted, rtol=0, atol=1e-6)


def test_votes_without_offsets_stay_within_the_shape(small, clouds) -> None:
    network = small()
    _silence_offsets(network)
    network.keypoint_predictor.output.weight.data[:12] *= 30  # strong opinions on where
    keypoints = network.keypoints(clouds)
    assert (keypoints <= clouds.amax(1, keepdim=True) + 1e-6).all()
    assert (keypoints >= clouds.amin(1, keepdim=True) - 1e-6).all()
    assert torch.pdist(keypoints[0]).max() > 0.05


def test_voting_against_a_slow_loop(small, clouds) -> None:
    network = small()
    predictor = network.keypoint_predictor
    caught = []
    handle = predictor.output.register_forward_hook(lambda _m, _i, result: caught.append(result))
    keypoints = network.keypoints(clouds)[1]
    handle.remove()
    votes = caught[0][1].double()
    for k in (0, 5, 11):
        weight = votes[:, k].exp() / votes[:, k].exp().sum()
        slow = sum(
            w * (p + v[12 + 3 * k : 15 + 3 * k]) for w, p, v in zip(weight, clouds[1].double(), votes, strict=True)
        )
        torch.testing.assert_close(keypoints[k].double(), slow, rtol=0, atol=1e-5)
