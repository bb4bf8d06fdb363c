"""The paper's numbers stand beside the rows of its methods and beside no others; times and steps are those measured."""

import pytest

from kpred.evaluation.metrics.metric import CD, SEEN, UCD, WHOLE, Metric
from kpred.evaluation.page import Page
from kpred.evaluation.tables.pages import pages
from kpred.evaluation.tables.published import FULL, PARTIAL, SCAN2CAD, published_pages
from kpred.evaluation.tables.table import Series, Subject, Table
from kpred.nn.config import preset

CATEGORIES = ("chair", "table", "cabinet")
SUBJECTS = [Subject("d", category, f"{category}{number}") for category in CATEGORIES for number in range(3)]
RECORD = {"peer": "u-red", "category": "chair", "training": {"optimisation": {"steps": 70, "batch": 8}}}
MODELS = {
    "residuals": {"folder": "runs/u-red", "training": [RECORD, {**RECORD, "category": "table", "stopped_after": 9}]},
    "cages": {"training": [{**RECORD, "peer": "neural-cages"}]},
    "paper": {"settings": {category: preset("kp-red", category).to_dict() for category in CATEGORIES}},
    "plus": {"settings": {"chair": preset("kp-red-plus", "chair").to_dict()}},
}


def make(kind: str, metrics: list[Metric], occlusions: tuple[float, ...] = (0.0,)) -> Table:
    """Every model has 1, 2, 3, 4 times the error of the first."""
    table = Table({"table": kind, "seed": 0, "unit": "u", "models": MODELS, "protocol": {"top_k": [10]}})
    protocol = "full" if kind == "full" else "partial"
    for number, name in enumerate(MODELS, start=1):
        for occlusion in occlusions:
            for method in ("feed_forward", "refined"):
                for metric in metrics:
                    for subject in SUBJECTS:
                        table.add(Series(name, method, protocol, occlusion, metric), subject, 0.01 * number)
    return table


def rows_of(page: Page) -> dict[tuple[object, object], list[object]]:
    """The cells after model and fraction hidden."""
    return {(row[0], row[1]): list(row[2:]) for row in page.rows}


def test_rows_of_the_papers_methods_have_its_numbers() -> None:
    (page,) = published_pages(make("full", [Metric(CD, top_k=10)]), "d")
    rows = rows_of(page)
    assert set(rows) == {("residuals", ""), ("paper", "")}
    *values, theirs, here = rows["residuals", ""]
    assert values == [f"{value:.3f}" for value in FULL["u-red"]]
    assert float(str(theirs)) == pytest.approx(0.143 / 0.089, abs=0.01)
    assert str(here).startswith("0.33")
    assert rows["paper", ""][-2:] == ["1.00", ""]
    assert "other data" in page.title


def test_real_scans_are_measured_from_the_annotated_model_as_in_the_paper() -> None:
    (page,) = published_pages(make("scan2cad", [Metric(UCD, SEEN, top_k=10), Metric(UCD, WHOLE, top_k=10)]), "d")
    assert [row[2] for row in page.rows] == [f"{SCAN2CAD[name][0]:.3f}" for name in ("u-red", "kp-red")]


def test_partial_rows_have_the_numbers_of_their_fraction_hidden() -> None:
    (page,) = published_pages(make("partial", [Metric(UCD, top_k=10)], (0.25, 0.6)), "d")
    rows = rows_of(page)
    assert set(rows) == {("residuals", "25%"), ("paper", "25%")}
    assert rows["paper", "25%"][:4] == [f"{value:.3f}" for value in PARTIAL[0.25]["kp-red"]]


def test_tables_without_the_papers_methods_have_no_such_page() -> None:
    table = make("full", [Metric(CD, top_k=10)])
    table.header["models"] = {name: {} for name in MODELS}
    assert not list(published_pages(table, "d"))


def test_times_and_steps_are_told() -> None:
    table = make("full", [Metric(CD, top_k=10)])
    table.header["machine"] = "a processor"
    table.header["processor_seconds"] = [
        {"model": "residuals", "method": "feed_forward", "n": 9, "mean": 0.25},
        {"model": "plus", "method": "refined", "n": 9, "mean": 0.5},
    ]
    page = list(pages(table))[-1]
    assert "a processor" in page.title
    assert page.rows[0] == ["residuals", "feed forward", "0.250", 9, "chair 70 steps of 8, table 9 steps of 8"]
    assert page.rows[1] == ["plus", "refined", "0.500", 9, ""]
