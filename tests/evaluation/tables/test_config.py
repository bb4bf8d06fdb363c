"""Settings of tables: which conditions each kind measures, and what is refused."""

from typing import Any

import pytest

from kpred.errors import ConfigError
from kpred.evaluation.tables.config import TableConfig


@pytest.mark.parametrize(
    ("kind", "occlusions", "wanted"),
    [
        ("full", (0.5,), [("full", 0.0)]),
        ("topk", (0.5,), [("full", 0.0)]),
        ("partial", (0.25, 0.5), [("partial", 0.25), ("partial", 0.5)]),
        ("all", (0.5,), [("full", 0.0), ("partial", 0.5)]),
        ("oracle", (), [("full", 0.0)]),
        ("oracle", (0.5,), [("full", 0.0), ("partial", 0.5)]),
        ("scan2cad", (0.5,), [("partial", 0.0)]),
    ],
)
def test_each_kind_has_its_conditions(kind: str, occlusions: tuple[float, ...], wanted: list) -> None:
    config = TableConfig(kind, occlusions=occlusions)
    assert [(one.protocol, one.occlusion) for one in config.conditions] == wanted


def test_numbers_come_once_and_ascend() -> None:
    assert TableConfig(top_k=(10, 1, 10)).numbers == (1, 10)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"kind": "half"}, "must be one of full, partial, all"),
        ({"top_k": (0,)}, "top_k must be at least 1, but is 0"),
        ({"top_k": ()}, "top_k must be at least 1, but is empty"),
        ({"kind": "partial", "occlusions": (1.0,)}, "Occlusions"),
        ({"kind": "partial", "occlusions": ()}, "Occlusions"),
        ({"kind": "oracle", "occlusions": (-0.1,)}, "Occlusions"),
    ],
)
def test_impossible_settings_are_refused(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        TableConfig(**changes)
