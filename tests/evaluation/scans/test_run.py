"""Runs over virtual scans: settings, groups, and summaries of every group and of all."""

from collections.abc import Sequence

import pytest

from kpred.errors import ConfigError
from kpred.evaluation.metrics.summary import Scope, Summary
from kpred.evaluation.remarks import Remarks
from kpred.evaluation.scans.outcome import FitOutcome
from kpred.evaluation.scans.run import ScanConfig, Scanned, summaries_of


def count(outcomes: Sequence[FitOutcome], scope: Scope) -> list[Summary]:
    return scope.fraction("failed", [one.failure is not None for one in outcomes], "scan")


def groups(places: list[tuple[str, str]]) -> list[tuple[str, str, int]]:
    scanned = [Scanned(dataset, FitOutcome(category=category), None) for dataset, category in places]
    return [(row.dataset, row.category, row.n) for row in summaries_of(scanned, count, "val", 0)]


def test_one_group_has_one_summary() -> None:
    assert groups([("a", "chair")] * 3) == [("a", "chair", 3)]


def test_all_of_one_data_set_are_taken_together_once() -> None:
    assert groups([("a", "chair"), ("a", "table")]) == [("a", "chair", 1), ("a", "table", 1), ("all", "all", 2)]


def test_several_data_sets_are_each_taken_together() -> None:
    found = groups([("a", "chair"), ("a", "table"), ("b", "chair"), ("b", "chair")])
    assert found == [
        ("a", "chair", 1),
        ("a", "table", 1),
        ("b", "chair", 2),
        ("a", "all", 2),
        ("all", "all", 4),
    ]


@pytest.mark.parametrize(
    ("changes", "words"), [({"views": -1}, "views"), ({"views": 99}, "views"), ({"top_k": 0}, "top_k")]
)
def test_impossible_settings_are_refused(changes: dict[str, int], words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        ScanConfig(**changes)


def test_remarks_are_kept_and_reported() -> None:
    told: list[str] = []
    every, unique = Remarks(told.append), Remarks(told.append, unique=True)
    for remarks in (every, unique):
        remarks("a")
        remarks("a")
    assert (every.sentences, unique.sentences, told) == (["a", "a"], ["a"], ["a", "a", "a"])
