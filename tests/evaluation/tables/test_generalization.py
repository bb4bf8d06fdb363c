"""Generalization: what is compared with what, that no target is its own template, and what the pages sum up."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from kpred.database import build_database
from kpred.errors import ConfigError, PackError
from kpred.evaluation.methods.kp_red import STRUCTURE
from kpred.evaluation.tables.generalization import RANDOM, GeneralizationConfig, generalization_table
from kpred.evaluation.tables.pages import pages
from kpred.evaluation.tables.scorer import FLOOR, UNDEFORMED
from kpred.evaluation.tables.table import Series, Table, read_table, write_table
from kpred.nn import Model
from kpred.shapes.source import Shape, open_shapes

CONFIG = GeneralizationConfig(limit=2, top_k=(1, 4), held_out=("table",))


@pytest.fixture(scope="module")
def table(packs: dict[str, Path], model: Model) -> Table:
    return generalization_table(list(packs.values()), model, config=CONFIG)


@pytest.fixture(scope="module")
def store(packs: dict[str, Path], model: Model, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """All twelve chairs, those of the split `val` too."""
    file = tmp_path_factory.mktemp("store") / "chairs.kpred"
    build_database(file, open_shapes(packs["chair"], None, None, lambda sentence: None), model)
    return file


def _values(table: Table, method: str, top_k: int | None = None) -> dict[str, float]:
    series: Series = next(one for one in table.values if (one.method, one.metric.top_k) == (method, top_k))
    return {subject.model_id: value for subject, value in table.values[series].items()}


def test_every_target_is_measured_by_every_method(table: Table) -> None:
    assert len(table.subjects()) == 4
    for method, top_k in ((STRUCTURE, 1), (STRUCTURE, 4), (RANDOM, 1), (RANDOM, 4), (UNDEFORMED, None), (FLOOR, None)):
        assert len(_values(table, method, top_k)) == 4
    assert table.header["database_models"] == {"generated/chair": 9, "generated/table": 9}


def test_a_target_is_no_template_of_itself(packs: dict[str, Path], store: Path, model: Model) -> None:
    inside = generalization_table([packs["chair"]], model, store, CONFIG)
    apart, floor = _values(inside, UNDEFORMED), _values(inside, FLOOR)
    assert all(apart[name] > 1.5 * floor[name] for name in apart), "the target itself was searched"
    itself = generalization_table([store], model, config=replace(CONFIG, limit=3, top_k=(1,)))
    assert len(itself.subjects()) == 3
    assert {subject.dataset for subject in itself.subjects()} == {"chairs"}
    assert all(_values(itself, UNDEFORMED)[name] > 1.5 * value for name, value in _values(itself, FLOOR).items())


def test_random_templates_depend_on_the_seed_alone(packs: dict[str, Path], store: Path, model: Model) -> None:
    config = replace(CONFIG, top_k=(1,))
    once, again, other = (
        _values(generalization_table([packs["chair"]], model, store, replace(config, seed=seed)), RANDOM, 1)
        for seed in (0, 0, 3)
    )
    assert once == again
    assert set(once.values()) != set(other.values())


def test_pages_compare_seen_and_held_out_categories(table: Table) -> None:
    shown = list(pages(table))
    assert len(shown) == 4
    rows = {str(row[0]): row for row in shown[0].rows}
    assert list(rows) == ["chair", "table", "seen in training", "held out", "all"]
    assert rows["held out"][1:] == rows["table"][1:]
    retrieved, random = _values(table, STRUCTURE, 1), _values(table, RANDOM, 1)
    ratio = np.mean(list(random.values())) / np.mean(list(retrieved.values()))
    assert str(rows["all"][-1]).startswith(f"{ratio:.2f}")
    held, seen = float(str(rows["held out"][2])), float(str(rows["seen in training"][2]))
    assert float(str(shown[1].rows[0][0])) == pytest.approx(held / seen, rel=0.02)


def test_it_survives_its_file(table: Table, tmp_path: Path) -> None:
    write_table(table, tmp_path / "table.json")
    again = read_table(tmp_path / "table.json")
    assert again.values == table.values
    assert [page.rows for page in pages(again)] == [page.rows for page in pages(table)]


def test_what_cannot_be_measured_is_said(packs: dict[str, Path], model: Model, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="at least 1"):
        GeneralizationConfig(top_k=(0,))
    few = tmp_path / "few.kpred"
    shapes: list[Shape] = list(open_shapes(packs["chair"], None, None, lambda sentence: None))[:2]
    build_database(few, shapes, model)
    with pytest.raises(PackError, match="enough templates"):
        generalization_table([packs["chair"], packs["table"]], model, few, CONFIG)
