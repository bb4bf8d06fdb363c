"""Region and global encoders: what a token may depend on."""

import pytest
import torch

from kpred.nn import ModelConfig
from kpred.nn.encoder import GlobalEncoder, RegionEncoder, TokenAttention, make_encoder


def _config(**settings) -> ModelConfig:
    return ModelConfig(width=16, region_points=300, **settings)


@pytest.fixture
def keypoints(clouds: torch.Tensor) -> torch.Tensor:
    return clouds[:, :12] * 0.9


@pytest.fixture(params=[True, False], ids=["region", "global"])
def encoder(request, seed: int):
    return make_encoder(_config(), local=request.param)


def test_the_switch_chooses_the_encoder() -> None:
    assert isinstance(make_encoder(_config(), True), RegionEncoder)
    assert isinstance(make_encoder(_config(), False), GlobalEncoder)


def test_tokens_differ_between_keypoints(encoder, clouds, keypoints) -> None:
    tokens = encoder(clouds, keypoints)
    assert tokens.shape == (3, 12, 16)
    assert all(torch.pdist(t).min() > 1e-3 for t in tokens)


def test_order_of_points_and_batches(encoder, clouds, keypoints, generator) -> None:
    tokens = encoder(clouds, keypoints)
    # Regions hold all members here, so that their choice does not depend on the order.
    shuffled = encoder(clouds[:, torch.randperm(256, generator=generator)], keypoints)
    torch.testing.assert_close(shuffled, tokens, rtol=0, atol=1e-5)
    alone = torch.cat([encoder(clouds[i : i + 1], keypoints[i : i + 1]) for i in range(3)])
    torch.testing.assert_close(alone, tokens, rtol=0, atol=1e-5)


def test_without_attention_a_token_sees_its_own_ball_alone(seed: int, clouds, keypoints) -> None:
    encoder = RegionEncoder(_config(stages=1))
    attention = encoder.attention[0]
    outside = torch.cdist(keypoints, clouds)[0, 3] > 0.3
    changed = clouds.clone()
    changed[0, outside] = torch.tensor([5.0, 5.0, 5.0])
    with_attention = encoder(changed, keypoints)[0, 3] - encoder(clouds, keypoints)[0, 3]
    assert with_attention.abs().max() > 1e-4, "attention brings nothing from the other regions"
    attention.merge.weight.data.zero_()
    local = encoder(changed, keypoints)[0, 3] - encoder(clouds, keypoints)[0, 3]
    assert local.abs().max() < 1e-6


def test_the_global_token_does_not_know_where_the_keypoints_are(seed: int, clouds, keypoints) -> None:
    encoder = GlobalEncoder(_config())
    assert torch.equal(encoder(clouds, keypoints), encoder(clouds, -keypoints))


@pytest.mark.parametrize("heads", [1, 2, 4])
def test_attention_block_against_torch(seed: int, generator, heads: int) -> None:
    block = TokenAttention(16, heads)
    tokens = torch.randn(2, 12, 16, generator=generator)
    slow = torch.nn.MultiheadAttention(16, heads, batch_first=True)
    slow.in_proj_weight.data, slow.in_proj_bias.data = block.project.weight.data, block.project.bias.data
    slow.out_proj.weight.data, slow.out_proj.bias.data = block.merge.weight.data, block.merge.bias.data
    normed = block.before(tokens)
    attended = tokens + slow(normed, normed, normed)[0]
    hidden = torch.nn.functional.leaky_relu(block.widen(block.after(attended)), 0.1)
    torch.testing.assert_close(block(tokens), attended + block.narrow(hidden), rtol=0, atol=1e-5)
    # Attention knows no order of the tokens.
    order = torch.randperm(12, generator=generator)
    torch.testing.assert_close(block(tokens[:, order]), block(tokens)[:, order], rtol=0, atol=1e-5)


def test_an_empty_region_still_gives_a_finite_token(encoder, clouds, keypoints) -> None:
    far = keypoints.clone()
    far[:, 0] = 1.2
    clouds = clouds * 0.5
    assert torch.isfinite(encoder(clouds, far)).all()
