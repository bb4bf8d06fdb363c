"""Printed tables: every cell stands where its series says, and ratios are ratios of the means beside them."""

import numpy as np
import pytest

from kpred.evaluation.metrics.metric import CD, FRACTION, MESH, NO_UNIT, SEEN, UCD, WHOLE, Metric
from kpred.evaluation.page import Page, brief
from kpred.evaluation.tables.compare import compare
from kpred.evaluation.tables.pages import comparison_pages, pages, ratio_pages
from kpred.evaluation.tables.ranking import CORRELATION, NEARLY_BEST, TRUE_BEST
from kpred.evaluation.tables.table import Series, Subject, Table

HEADER = {
    "seed": 0,
    "unit": "unit box squared",
    "frame": "known unit box",
    "models": {"m": {}},
    "protocol": {"top_k": [10]},
    "database_models": {"d/chair": 7, "d/table": 9},
}
SUBJECTS = [Subject("d", category, f"{category}{number}") for category in ("chair", "table") for number in range(5)]


def make(kind: str, series: list[Series]) -> Table:
    """A table of values that rise from series to series."""
    table = Table({**HEADER, "table": kind})
    for number, one in enumerate(series, start=1):
        for place, subject in enumerate(SUBJECTS):
            table.add(one, subject, 0.01 * number + 0.001 * place)
    return table


def rows_of(page: Page) -> dict[tuple[object, ...], dict[str, object]]:
    """Cells by the first two columns."""
    return {tuple(row[:2]): dict(zip(page.columns, row, strict=True)) for row in page.rows}


FULL = [
    Series("", "undeformed_nearest", "full", 0.0, Metric(CD)),
    Series("", "no_learning", "full", 0.0, Metric(CD, top_k=10)),
    Series("m", "structure", "full", 0.0, Metric(CD, top_k=10)),
    Series("m", "structure_without_hint", "full", 0.0, Metric(CD, top_k=10)),
    Series("m", "structure", "full", 0.0, Metric("squareness", MESH, "degrees", 10)),
]


def test_full_has_categories_side_by_side_the_hint_and_cleanliness() -> None:
    table = make("full", FULL)
    errors, hint, mean, tail = pages(table)
    rows = rows_of(errors)
    assert [name for name in errors.columns if name in ("chair", "table", "all")] == ["chair", "table", "all"]
    values = np.array([0.03 + 0.001 * place for place in range(10)])
    assert str(rows["m", "structure"]["all"]).startswith(f"{values.mean():.5f} (")
    ratio = values.mean() / (values - 0.01).mean()
    assert str(rows["m", "structure"]["/ no learning"]).startswith(f"{ratio:.2f}")
    assert str(hint.rows[0][-1]).startswith(f"{(values + 0.01).mean() / values.mean():.2f}")
    assert rows_of(mean)["all", "m"]["square °"] == pytest.approx(0.0545, abs=1e-4)
    assert rows_of(tail)["all", "m"]["square °"] == pytest.approx(np.percentile(values + 0.02, 95), abs=1e-4)


def test_ratios_are_those_of_the_means_under_the_same_condition() -> None:
    partial = [
        Series(one.model, one.method, "partial", 0.5, Metric(UCD, surface, top_k=one.metric.top_k))
        for one in FULL[:3]
        for surface in (SEEN, WHOLE)
    ]
    table = make("all", [*FULL[:3], *partial])
    page = next(ratio_pages(table))
    assert page.title.startswith("d / chair: 5 targets against 7 models")
    found = {tuple(row[1:5]): row[5:] for row in page.rows}
    for hidden, distance in (("", "CD"), ("50%", "UCD"), ("50%", "UCD, whole")):
        value, undeformed, unlearned = found["structure", hidden, distance, "10"]
        assert undeformed == pytest.approx(value / found["undeformed nearest", hidden, distance, "all"][0])
        assert unlearned == pytest.approx(value / found["no learning", hidden, distance, "10"][0])


def test_partial_has_a_column_for_each_occlusion() -> None:
    series = [
        Series("m", "refined", "partial", occlusion, Metric(UCD, surface, top_k=10))
        for occlusion in (0.0, 0.5)
        for surface in (WHOLE, SEEN)
    ]
    first = next(pages(make("partial", series)))
    assert list(first.columns) == ["distance", "model", "method", "0% hidden", "50% hidden"]
    assert [row[0] for row in first.rows] == ["UCD", "UCD, whole"]
    assert all(row[3] and row[4] for row in first.rows)


def test_oracle_sorts_rankings_and_errors_apart() -> None:
    series = [
        Series("m", "tokens", "full", 0.0, Metric(TRUE_BEST, SEEN, FRACTION, 5)),
        Series("m", "tokens", "full", 0.0, Metric(NEARLY_BEST, SEEN, FRACTION, 5)),
        Series("m", "tokens", "full", 0.0, Metric(CORRELATION, SEEN, NO_UNIT)),
        Series("m", "refined", "full", 0.0, Metric(CD, top_k=5)),
        Series("m", "refined", "full", 0.0, Metric(CD)),
    ]
    best, near, errors, *_ = pages(make("oracle", series))
    assert list(best.columns) == ["model", "hidden", "order by", "top 5", "spearman"]
    assert list(near.columns) == ["model", "hidden", "order by", "top 5"]
    assert list(errors.columns) == ["model", "hidden", "method", "top 5", "all"]


def test_a_comparison_shows_errors_alone() -> None:
    table = make("full", FULL)
    found = compare(table, table, "m", "m")
    (page,) = comparison_pages(found)
    assert {row[1] for row in page.rows} == {"structure", "structure without hint"}
    assert {row[8] for row in page.rows} == {"1.000 (1.000–1.000)"}


def test_brief_says_how_many_more_there_are() -> None:
    assert list(brief(["a", "b", "c"], 2)) == ["a", "b", "and 1 more"]
    assert list(brief(["a", "b"], 2)) == ["a", "b"]
