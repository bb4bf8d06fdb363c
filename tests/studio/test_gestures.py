"""Gestures survive JSON; what no person could have done is refused in one sentence."""

import json
from typing import Any

import pytest

from kpred.errors import ConfigError
from kpred.studio.gestures import (
    WHOLE,
    ChooseCategory,
    ChooseDeform,
    ChooseModel,
    ChooseUnit,
    ChooseUp,
    Crop,
    Gesture,
    MoveKeypoint,
    PinKeypoint,
    RefitRest,
    SetSize,
    Turn,
    from_json,
    to_json,
)

TURNED = ((0.6, 0.0, 0.8), (0.0, 1.0, 0.0), (-0.8, 0.0, 0.6))

ONE_OF_EACH: list[Gesture] = [
    ChooseCategory("chair"),
    ChooseUp("-z"),
    Turn(-90.0),
    ChooseDeform("scale"),
    ChooseUnit("mm"),
    Crop((0.0, 0.1, 0.2), (1.0, 1.1, 1.2), TURNED),
    ChooseModel("chair_7"),
    MoveKeypoint(3, (0.1, 0.2, 0.3), True, "y"),
    MoveKeypoint(3, (0.1, 0.2, 0.3)),
    PinKeypoint(4, False),
    SetSize(WHOLE, "y", 0.8),
    RefitRest(),
]


@pytest.mark.parametrize("gesture", ONE_OF_EACH, ids=lambda gesture: type(gesture).__name__)
def test_a_gesture_survives_json(gesture: Gesture) -> None:
    assert from_json(json.loads(json.dumps(to_json(gesture)))) == gesture


@pytest.mark.parametrize(
    "value",
    [
        [],
        {"gesture": "Delete"},
        {"gesture": ["Turn"]},
        {"gesture": "Turn"},
        {"gesture": "Turn", "degrees": "90"},
        {"gesture": "Turn", "degrees": float("nan")},
        {"gesture": "Turn", "degrees": 1e300},
        {"gesture": "Turn", "degrees": True},
        {"gesture": "Turn", "degrees": 90, "path": "/etc/passwd"},
        {"gesture": "ChooseUp", "up": "w"},
        {"gesture": "ChooseDeform", "deform": "melt"},
        {"gesture": "ChooseUnit", "unit": "mile"},
        {"gesture": "ChooseModel", "model_id": 3},
        {"gesture": "MoveKeypoint", "keypoint": 1.5, "place": [0, 0, 0]},
        {"gesture": "MoveKeypoint", "keypoint": 1, "place": [0, 0]},
        {"gesture": "MoveKeypoint", "keypoint": 1, "place": [0, 0, 0], "axis": "w"},
        {"gesture": "PinKeypoint", "keypoint": True, "pinned": True},
        {"gesture": "SetSize", "part": 0, "axis": "y", "length": 0},
        {"gesture": "SetSize", "part": 0, "axis": "y", "length": -1},
        {"gesture": "Crop", "low": [0, 0, 0], "high": [1, 0, 1]},
        {"gesture": "Crop", "low": [0, 0, 0], "high": [1, 1, 1], "axes": [[1, 0, 0], [0, 1, 0]]},
        {"gesture": "Crop", "low": [0, 0, 0], "high": [1, 1, 1], "axes": [[1, 0, 0], [1, 0, 0], [0, 0, 1]]},
    ],
)
def test_hostile_values_are_refused(value: Any) -> None:
    with pytest.raises(ConfigError):
        from_json(value)
