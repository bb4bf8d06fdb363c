"""One category's networks: shapes under every switch, confidence, fingerprints, stages."""

import itertools
import math

import pytest
import torch

from kpred.nn import PRESETS, STAGES, KPRed, preset
from kpred.nn.retrieval import DECODED_POINTS

SWITCHES = ("self_attention", "deformation_aware", "local_global", "confidence")
COMBINATIONS = [dict(zip(SWITCHES, values)) for values in itertools.product([True, False], repeat=4)]


def _check_shapes(network: KPRed, clouds: torch.Tensor) -> None:
    config, batch = network.config, len(clouds)
    with torch.no_grad():
        keypoints, partial = network.keypoints(clouds), network.partial_keypoints(clouds)
        cage = network.cage(clouds)
        tokens = network.retrieval_tokens(clouds, keypoints)
        found = {
            "keypoints": keypoints,
            "partial": partial,
            "cage": cage,
            "influence": network.influence(clouds, keypoints, cage),
            "tokens": tokens,
            "partial tokens": network.partial_retrieval_tokens(clouds, partial),
            "confidence": network.confidence(clouds, keypoints),
            "decoded": network.region_decoder(tokens, keypoints),
        }
    count, vertices = config.keypoints, config.cage_vertices
    assert {name: tuple(value.shape) for name, value in found.items()} == {
        "keypoints": (batch, count, 3),
        "partial": (batch, count, 3),
        "cage": (batch, vertices, 3),
        "influence": (batch, count, vertices),
        "tokens": (batch, count, config.token_size),
        "partial tokens": (batch, count, config.token_size),
        "confidence": (batch, count),
        "decoded": (batch, count, DECODED_POINTS, 3),
    }
    assert all(torch.isfinite(value).all() for value in found.values())


@pytest.mark.parametrize("switches", COMBINATIONS, ids=lambda s: "".join("+" if v else "-" for v in s.values()))
def test_shapes_of_every_ablation(small, clouds, switches: dict[str, bool]) -> None:
    _check_shapes(small(**switches), clouds)


@pytest.mark.parametrize(
    "settings",
    [
        {"keypoint_head": "regression"},
        {"influence": "local"},
        {"cage": "pulled"},
        {"cage_subdivisions": 2, "influence_neighbours": 30},
        {"stages": 1},
        {"stages": 3, "heads": 4},
        {"keypoints": 6, "token_size": 4},
    ],
    ids=str,
)
def test_shapes_of_other_settings(small, clouds, settings) -> None:
    _check_shapes(small(**settings), clouds)


@pytest.mark.parametrize("name", PRESETS)
def test_shapes_of_the_presets(clouds, name: str) -> None:
    _check_shapes(KPRed(preset(name, "chair")).eval(), clouds[:1])


def test_gsa_and_lgf_switch_their_own_part(small) -> None:
    plain, no_gsa, no_lgf = (
        set(small(**s).state_dict()) for s in ({}, {"self_attention": False}, {"local_global": False})
    )
    assert any("attention" in key for key in plain)
    assert not any("attention" in key for key in no_gsa if key.startswith("influence_predictor"))
    assert {key for key in no_gsa if key.startswith("retrieval")} == {
        key for key in plain if key.startswith("retrieval")
    }
    assert not any("attention" in key for key in no_lgf if "retrieval_encoder" in key)


def test_confidence_follows_the_density_of_the_region(small, generator) -> None:
    network = small(density=300.0)
    keypoints = torch.zeros(1, 12, 3)
    keypoints[:, 1:, 0] = 1.0
    cloud = torch.full((1, 2048, 3), -1.0)
    cloud[0, :7] = 0.05 * torch.randn(7, 3, generator=generator)
    confidence = network.confidence(cloud, keypoints)
    assert confidence[0, 0].item() == pytest.approx(7 / (300 * 4 / 3 * math.pi * 0.3**3), rel=1e-5)
    assert (confidence[0, 1:] == 0).all()
    assert (small(confidence=False).confidence(cloud, keypoints) == 1).all()


def test_the_cage_setting_chooses_the_cage(small, clouds) -> None:
    from kpred.ops import enclosing_cage, pulled_in_cage

    assert torch.equal(small(cage="enclosing").cage(clouds), enclosing_cage(clouds))
    assert torch.equal(small(cage="pulled").cage(clouds), pulled_in_cage(clouds))


def test_decoded_regions_follow_their_token(small, clouds, generator) -> None:
    decoder = small().region_decoder
    tokens, keypoints = torch.randn(1, 12, 8, generator=generator), clouds[:1, :12]
    regions = decoder(tokens, keypoints)
    changed = tokens.clone()
    changed[0, 4] += 1
    moved = (decoder(changed, keypoints) - regions).abs().amax((2, 3))[0]
    assert moved[4] > 1e-3
    assert (moved[[k for k in range(12) if k != 4]] == 0).all()
    # All keypoints reach all regions: that is how a region knows of the deformation.
    elsewhere = keypoints.clone()
    elsewhere[0, 7] += 0.5
    assert ((decoder(tokens, elsewhere) - regions).abs().amax((2, 3))[0] > 1e-4).all()


def test_the_parts_of_the_stages_are_all_parts_once(small) -> None:
    parts = [part for names in STAGES.values() for part in names]
    assert sorted(parts) == sorted(name for name, _ in small().named_children())


def test_fingerprint_tells_weights_and_settings_apart(small) -> None:
    network = small()
    mark = network.fingerprint()
    assert mark == small().fingerprint()
    assert len({mark, small(seed=1).fingerprint(), small(density=200.0).fingerprint()}) == 3
    for part in ("keypoint_predictor", "influence_predictor", "retrieval_encoder"):
        parameter = next(getattr(network, part).parameters())
        kept = parameter.data.clone()
        parameter.data[0] += 0.1
        assert network.fingerprint() != mark, f"a change of {part} goes unnoticed"
        parameter.data = kept
    # What makes neither tokens nor bases of a database does not matter to it.
    next(network.partial_keypoint_predictor.parameters()).data += 0.1
    assert network.fingerprint() == mark
