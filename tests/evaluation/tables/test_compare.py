"""Comparisons pair targets, agree with slow references, and refuse what does not pair up."""

import copy

import numpy as np
import pytest
from scipy.stats import wilcoxon

from kpred.errors import ConfigError
from kpred.evaluation.metrics.metric import Metric
from kpred.evaluation.tables.compare import compare, settings_changed
from kpred.evaluation.tables.table import Series, Subject, Table


def make(model: str, shift: float = 0.0, seed: int = 0, width: int = 8) -> Table:
    """20 chairs and 10 tables, one method, one model."""
    header = {
        "table": "full",
        "seed": 0,
        "data": [{"dataset": "d", "category": "chair", "sha256": "x"}],
        "protocol": {"split": "val", "seed": 0, "top_k": [10]},
        "models": {model: {"settings": {"chair": {"width": width}}}},
    }
    table = Table(header)
    rng = np.random.default_rng(seed)
    for number in range(30):
        subject = Subject("d", "chair" if number < 20 else "table", f"s{number}")
        table.add(
            Series(model, "refined", "full", 0.0, Metric("cd", top_k=10)), subject, float(rng.random() + 1 + shift)
        )
        table.add(Series("", "sampling_floor", "full", 0.0, Metric("cd")), subject, 0.5)
    return table


def test_it_is_the_paired_test_of_the_values() -> None:
    a, b = make("a"), make("b", shift=-0.1, seed=1)
    found = {one.category: one for one in compare(a, b)}
    assert set(found) == {"chair", "table", "all"}
    first, second = (np.array(list(t.values[next(iter(t.values))].values())) for t in (a, b))
    assert found["all"].ratio == pytest.approx(second.mean() / first.mean())
    assert found["all"].p_value == pytest.approx(wilcoxon(second, first).pvalue)
    assert found["all"].better == pytest.approx((second < first).mean())
    assert (found["all"].n, found["chair"].n) == (30, 20)


def test_a_sure_gain_is_sure_and_no_change_is_none() -> None:
    a, b = make("a"), make("b", shift=-0.05)
    sure = compare(a, b)[-1]
    assert sure.high is not None and sure.high < 1
    assert sure.p_value is not None and sure.p_value < 1e-6
    assert sure.better == 1.0
    none = compare(a, make("b"))[-1]
    assert (none.ratio, none.low, none.high, none.p_value, none.better) == (1.0, 1.0, 1.0, 1.0, 0.5)


def test_swapping_the_tables_turns_the_ratio_over() -> None:
    a, b = make("a"), make("b", shift=0.3, seed=2)
    there, back = compare(a, b)[0], compare(b, a)[0]
    assert there.ratio == pytest.approx(1 / back.ratio)
    assert there.p_value == pytest.approx(back.p_value)


@pytest.mark.parametrize(
    ("path", "value", "words"),
    [
        (("table",), "partial", "kinds of tables"),
        (("protocol", "seed"), 1, "seed: 0 and 1"),
        (("protocol", "top_k"), [25], "top_k"),
        (("data", 0, "sha256"), "y", "different data"),
    ],
)
def test_other_protocols_data_and_seeds_are_refused(path: tuple, value: object, words: str) -> None:
    a, b = make("a"), make("b")
    b.header.update(copy.deepcopy(b.header))
    place = b.header
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    with pytest.raises(ConfigError, match=words):
        compare(a, b)


def test_other_targets_are_refused() -> None:
    a, b = make("a"), make("b")
    for values in b.values.values():
        values.pop(Subject("d", "chair", "s3"))
    with pytest.raises(ConfigError, match="30 and 29; s3 is in one"):
        compare(a, b)


def test_models_are_told_apart() -> None:
    both = make("a")
    both.header["models"]["b"] = {"settings": {"chair": {"width": 9}}}
    for series, values in make("b", shift=0.1).values.items():
        both.values[series] = values
    with pytest.raises(ConfigError, match="models a, b; say which"):
        compare(both, both)
    with pytest.raises(ConfigError, match="no model 'c'"):
        compare(both, both, "a", "c")
    assert compare(both, both, "a", "b")[0].ratio > 1
    assert settings_changed(both, both, "a", "b") == ["width: 8 and 9 (chair)"]
