"""The typed configuration: round trip, presets, and refusals in one sentence."""

import dataclasses
import json

import pytest

from kpred.errors import ConfigError
from kpred.nn import PRESETS, ModelConfig, preset


def test_round_trip_through_json_with_every_setting_changed() -> None:
    changed = ModelConfig(
        category="table", keypoints=8, token_size=16, radius=0.4, region_points=32, width=64, stages=3, heads=4,
        keypoint_head="regression", self_attention=False, deformation_aware=False, local_global=False,
        confidence=False, partial_blocks=1, box_blocks=1, influence="local", influence_neighbours=5, cage="pulled",
        cage_subdivisions=2, density=100.0,
    )  # fmt: skip
    plain = ModelConfig().to_dict()
    assert all(plain[key] != value for key, value in changed.to_dict().items()), "a setting was left unchanged"
    assert ModelConfig.from_dict(json.loads(json.dumps(changed.to_dict()))) == changed
    assert ModelConfig.from_dict({}) == ModelConfig()


def test_unknown_settings_are_named() -> None:
    with pytest.raises(ConfigError, match="no_such.*newer kpred"):
        ModelConfig.from_dict({**ModelConfig().to_dict(), "no_such": 1})


@pytest.mark.parametrize(
    "settings",
    [
        {"keypoints": 0},
        {"token_size": 0},
        {"region_points": 0},
        {"stages": 0},
        {"influence_neighbours": 0},
        {"width": 10, "heads": 4},
        {"heads": 0},
        {"radius": 0.0},
        {"radius": -1.0},
        {"radius": 2.5},
        {"keypoint_head": "votes"},
        {"influence": "global"},
        {"cage": "none"},
        {"self_attention": "yes"},
        {"stages": 2.5},
    ],
    ids=str,
)
def test_impossible_settings_are_refused(settings: dict[str, object]) -> None:
    with pytest.raises(ConfigError, match=next(iter(settings))):
        ModelConfig.from_dict(settings)


def test_presets() -> None:
    assert preset("kp-red-plus", "chair") == ModelConfig(category="chair", partial_blocks=2, box_blocks=2)
    paper = preset("kp-red", "table")
    assert (paper.category, paper.keypoints, paper.token_size, paper.radius) == ("table", 12, 128, 0.3)
    assert (paper.keypoint_head, paper.influence, paper.influence_neighbours) == ("regression", "local", 5)
    assert (paper.cage, paper.cage_vertices, paper.region_points, paper.stages, paper.heads) == (
        "pulled",
        42,
        192,
        3,
        2,
    )
    assert preset("kp-red", "table", stages=1) == dataclasses.replace(paper, stages=1)
    with pytest.raises(ConfigError, match=", ".join(PRESETS)):
        preset("kp-blue", "chair")


def test_cage_vertices_are_those_of_the_icosphere() -> None:
    from kpred.ops import icosphere

    for subdivisions in range(3):
        assert ModelConfig(cage_subdivisions=subdivisions).cage_vertices == len(icosphere(subdivisions)[0])


def test_weights_from_before_the_setting_of_box_blocks_are_read_as_they_were_made() -> None:
    values = preset("kp-red-plus", "chair").to_dict()
    del values["box_blocks"]
    assert ModelConfig.from_dict(values).box_blocks == 1
    assert ModelConfig.from_dict({**values, "partial_blocks": 0}).box_blocks == 0
