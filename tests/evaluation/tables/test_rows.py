"""Rows: means, ratios and the JSON they are written as."""

import json
from pathlib import Path

import numpy as np
import pytest

from kpred.errors import OutputError
from kpred.evaluation.tables.rows import CD, UCD, UCD_WHOLE, Score, aggregate, write_rows


def _score(metric: str, value: float, top_k: int | None = 10, distance: str = CD, occlusion: float = 0.0) -> Score:
    return Score("full" if distance == CD else "partial", occlusion, metric, distance, top_k, value)


def _aggregate(scores: list[Score]) -> dict:
    rows = aggregate(scores, dataset="d", split="val", category="chair", database_models=7)
    return {(row.metric, row.top_k, row.occlusion): row for row in rows}


def test_values_are_means_over_instances_and_ratios_are_ratios_of_means() -> None:
    scores = [
        _score("undeformed_nearest", 0.01, None), _score("no_learning", 0.006), _score("refined", 0.002),
        _score("undeformed_nearest", 0.03, None), _score("no_learning", 0.008), _score("refined", 0.010),
    ]  # fmt: skip
    rows = _aggregate(scores)
    refined = rows["refined", 10, 0.0]
    assert refined.value == pytest.approx(0.006)
    assert refined.n == 2
    assert refined.ratio_to_undeformed == pytest.approx(0.006 / 0.02)
    assert refined.ratio_to_no_learning == pytest.approx(0.006 / 0.007)
    assert rows["undeformed_nearest", None, 0.0].ratio_to_undeformed == 1


def test_ratios_are_taken_at_the_same_occlusion_top_k_and_distance() -> None:
    scores = [
        _score("undeformed_nearest", 0.01, None, UCD, 0.25), _score("undeformed_nearest", 0.02, None, UCD, 0.5),
        _score("undeformed_nearest_whole", 0.04, None, UCD_WHOLE, 0.5),
        _score("no_learning", 0.004, 1, UCD, 0.5), _score("no_learning", 0.002, 10, UCD, 0.5),
        _score("refined", 0.005, 1, UCD, 0.5), _score("refined", 0.001, 10, UCD, 0.5),
        _score("refined", 0.003, 10, UCD, 0.25), _score("refined_whole", 0.008, 10, UCD_WHOLE, 0.5),
    ]  # fmt: skip
    rows = _aggregate(scores)
    assert rows["refined", 10, 0.5].ratio_to_undeformed == pytest.approx(0.05)
    assert rows["refined", 10, 0.25].ratio_to_undeformed == pytest.approx(0.3)
    assert rows["refined", 10, 0.5].ratio_to_no_learning == pytest.approx(0.5)
    assert rows["refined", 1, 0.5].ratio_to_no_learning == pytest.approx(1.25)
    assert rows["refined", 10, 0.25].ratio_to_no_learning is None
    assert rows["refined_whole", 10, 0.5].ratio_to_undeformed == pytest.approx(0.2)


def test_the_tail_is_the_95th_percentile_of_the_instances() -> None:
    rows = _aggregate([_score("refined", value) for value in np.arange(101.0)])
    assert rows["refined", 10, 0.0].percentile_95 == pytest.approx(95.0)
    lost = _aggregate([_score("refined", 1.0), _score("refined", float("inf"))])
    assert lost["refined", 10, 0.0].percentile_95 == float("inf")


def test_a_measure_of_cleanliness_keeps_its_unit_and_has_no_ratio() -> None:
    clean = Score("full", 0.0, "refined", "squareness", 10, 3.0, "degrees")
    rows = aggregate(
        [_score("undeformed_nearest", 0.01, None), clean], dataset="d", split="val", category="c", database_models=7
    )
    assert (rows[1].unit, rows[1].ratio_to_undeformed) == ("degrees", None)
    assert rows[0].unit == "unit box squared"


def test_a_base_of_zero_gives_no_ratio() -> None:
    rows = _aggregate([_score("undeformed_nearest", 0.0, None), _score("refined", 0.1)])
    assert rows["refined", 10, 0.0].ratio_to_undeformed is None


def test_rows_are_written_whole_or_not_at_all(tmp_path: Path) -> None:
    rows = aggregate([_score("refined", float("nan"))], dataset="d", split="val", category="c", database_models=1)
    write_rows(tmp_path / "rows.json", {"seed": 3}, rows)
    read = json.loads((tmp_path / "rows.json").read_text())
    assert read["header"] == {"seed": 3}
    assert read["rows"][0]["value"] is None
    wanted = {"dataset", "split", "category", "protocol", "occlusion", "top_k", "metric", "unit", "frame", "value", "n"}
    assert wanted <= set(read["rows"][0])
    with pytest.raises(OutputError, match="missing"):
        write_rows(tmp_path / "missing" / "rows.json", {}, rows)
