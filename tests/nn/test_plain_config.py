"""Plain values and back: every kind of setting comes back, and what cannot be is named."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import Literal

import pytest

from kpred.errors import ConfigError
from kpred.nn.plain_config import PlainConfig


@dataclass(frozen=True)
class Inner(PlainConfig):
    steps: int = 1


@dataclass(frozen=True)
class Outer(PlainConfig):
    inner: Inner = field(default_factory=Inner)
    names: tuple[str, ...] = ()
    limits: tuple[float, float] = (0.0, 1.0)
    rate: float = 0.5
    kind: Literal["near", "far"] = "near"
    fast: bool = False


CHANGED = Outer(Inner(3), ("a", "b"), (0.25, 0.75), 2.0, "far", True)


def test_all_kinds_of_settings_come_back_through_json() -> None:
    assert Outer.from_dict(json.loads(json.dumps(CHANGED.to_dict()))) == CHANGED
    assert Outer.from_dict({}) == Outer()
    assert Outer.from_dict({"rate": 1}).rate == 1.0


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"speed": 1}, r"unknown settings \['speed'\].*newer kpred"),
        ({"inner": {"speed": 1}}, r"unknown settings \['speed'\]"),
        ({"inner": 3}, "inner must be of type Inner"),
        ({"names": "ab"}, "names must be a list of str"),
        ({"names": ["a", 1]}, "names must be of type str"),
        ({"limits": [1.0]}, "limits must be a list of float"),
        ({"rate": True}, "rate must be of type float"),
        ({"rate": "1"}, "rate must be of type float"),
        ({"kind": "nearer"}, "kind must be one of near, far"),
        ({"fast": 1}, "fast must be of type bool"),
    ],
    ids=str,
)
def test_what_cannot_be_is_named(values: dict[str, object], words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        Outer.from_dict(values)
