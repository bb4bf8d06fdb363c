"""The ablation table: rows as they come, kept beside their weights, and what each part does."""

from collections.abc import Callable
from pathlib import Path

import pytest

from kpred.errors import ConfigError
from kpred.evaluation.tables import ablation_table
from kpred.evaluation.tables.ablation_table import EFFECTS, effects, make_ablation_table
from kpred.evaluation.tables.config import TableConfig
from kpred.evaluation.tables.make_table import make_table
from kpred.evaluation.tables.packs import OpenPack, SourcePack
from kpred.evaluation.tables.table import Table
from kpred.nn import ModelConfig
from kpred.shapes.pack import MeshPack
from kpred.synthetic.generator import generate
from kpred.training.ablations import ROWS, AblationRuns, rows_named
from kpred.training.config import StageConfig, TrainConfig

STAGE = StageConfig(steps=2, batch=2)
TRAIN = TrainConfig(deformation=STAGE, retrieval=STAGE, partial=STAGE, points=96, keypoint_points=64, warmup=1)
CONFIG = TableConfig("full", top_k=(2,), occlusions=(0.5,))
NAMED = ("e", "f", "with-cb", "without-cb")


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("packs") / "table.npz"
    tables = generate("table", 8, seed=4, splits=False)
    splits = ["source"] * 3 + ["train"] * 3 + ["val"] * 2
    MeshPack.from_meshes(list(tables), list(tables.model_id), splits, "table").save(file)
    return file


def _runs(source: SourcePack, folder: Path, data_hash: str) -> AblationRuns:
    model = ModelConfig(category=source.pack.category, width=16, token_size=8, region_points=16, stages=1)
    return AblationRuns([source.pack], model, TRAIN, folder, data_hash)


@pytest.fixture(scope="module")
def made(small: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Table, Path]:
    folder = tmp_path_factory.mktemp("runs")
    return make_ablation_table([small], rows_named(NAMED), folder, _runs, CONFIG), folder


def _place(small: Path, folder: Path, row: str) -> Path:
    return folder / small.parent.name / "table" / row


def test_every_row_is_measured_as_a_model_of_its_own(made: tuple[Table, Path], small: Path) -> None:
    table, folder = made
    assert {one.model for one in table.values} == set(NAMED)
    assert {one.protocol for one in table.values if one.model == "f"} == {"full"}
    assert {one.protocol for one in table.values if one.model == "with-cb"} == {"partial"}
    alone = make_table([small], {"f": _place(small, folder, "f") / "model"}, CONFIG)
    for series, values in table.values.items():
        if series.model == "f":
            assert alone.values[series] == pytest.approx(values)
    assert set(table.header["models"]) == set(NAMED)
    assert table.header["models"]["e"]["settings"]["table"]["local_global"] is False


def test_a_stopped_table_keeps_the_rows_that_were_done(
    made: tuple[Table, Path], small: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    table, folder = made
    (measured,) = _place(small, folder, "f").glob("measured-*[0-9a-f].json")
    measured.unlink()
    real: Callable = ablation_table.add_scores
    asked: list[str] = []

    def counting(table: Table, pack: OpenPack, models: dict, *rest: object, **more: object) -> None:
        asked.extend(models)
        real(table, pack, models, *rest, **more)

    monkeypatch.setattr(ablation_table, "add_scores", counting)
    again = make_ablation_table([small], rows_named(NAMED), folder, _runs, CONFIG)
    assert asked == ["f"]
    assert again.values == table.values


def test_rows_that_are_not_trained_are_left_out_and_told(made: tuple[Table, Path], small: Path) -> None:
    table, folder = made
    told: list[str] = []
    some = make_ablation_table(
        [small], list(ROWS.values()), folder, _runs, CONFIG, only_finished=True, report=told.append
    )
    assert some.values == table.values
    assert [sentence.partition("row ")[2].partition(":")[0] for sentence in told] == ["a", "b", "c", "d"]
    assert some.header["remarks"] == told
    assert not _place(small, folder, "a").exists()
    with pytest.raises(ConfigError, match="no finished row"):
        make_ablation_table([small], rows_named(["a"]), folder, _runs, CONFIG, only_finished=True)


def test_effects_compare_rows_that_differ_in_one_part(made: tuple[Table, Path]) -> None:
    for part, without, having in EFFECTS:
        one, other = ROWS[without], ROWS[having]
        switches = {name: (getattr(one, name), getattr(other, name)) for name in ("gsa", "dar", "lgf", "cb")}
        assert {name for name, (a, b) in switches.items() if a != b} == {part.lower()}
        assert switches[part.lower()] == (False, True)
    table, _ = made
    found = effects(table)
    assert {(one.part, one.without, one.having) for one in found} == {
        ("LGF", "e", "f"),
        ("CB", "without-cb", "with-cb"),
    }
    refined = next(one for one in found if one.part == "LGF" and one.comparison.series.method == "refined")
    with_it, without_it = (
        table.cell(next(s for s in table.values if (s.model, s.method) == (row, "refined")), *_group(table))
        for row in ("f", "e")
    )
    assert with_it is not None and without_it is not None
    assert refined.comparison.ratio == pytest.approx(with_it.value / without_it.value)


def _group(table: Table) -> tuple[str, str]:
    dataset = table.datasets()[0]
    return dataset, table.categories(dataset)[-1]


def test_two_packs_of_one_category_are_refused(small: Path, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="one pack of each"):
        make_ablation_table([small, small], rows_named(["f"]), tmp_path, _runs, CONFIG)
