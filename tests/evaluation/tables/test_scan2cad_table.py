"""Real scans in a table: the known frame is that of the annotated model, and what is missing is counted and told."""

import json
import shutil
from pathlib import Path

import pytest

from kpred.errors import ScanError
from kpred.evaluation.metrics.metric import SEEN, WHOLE
from kpred.evaluation.tables.config import TableConfig
from kpred.evaluation.tables.scan2cad_table import ANNOTATED, make_scan2cad_table
from kpred.evaluation.tables.table import Subject, Table
from kpred.nn import Model

CONFIG = TableConfig("scan2cad", top_k=(2,), unknown_frame=True)


@pytest.fixture(scope="module")
def made(layout: Path, packs: dict[str, Path], model: Model) -> tuple[Table, list[str]]:
    told: list[str] = []
    source = list(packs.values())
    return make_scan2cad_table([layout], {"m": model}, CONFIG, source=source, report=told.append), told


def _value(table: Table, method: str, surface: str = SEEN) -> float:
    (series,) = [one for one in table.values if (one.method, one.metric.surface) == (method, surface)]
    (value,) = table.values[series].values()
    return value


def test_the_scan_lies_on_the_annotated_model_in_its_own_frame(made: tuple[Table, list[str]], layout: Path) -> None:
    table, _ = made
    assert table.subjects() == [Subject(layout.name, "chair", "scene0001_00 chair_0")]
    # The scan was sampled on that very model: only the spacing of 2048 points is left of the distance.
    assert _value(table, ANNOTATED) < 0.003
    assert _value(table, ANNOTATED) < 0.5 * _value(table, "undeformed_nearest")
    for method in ("no_learning", "feed_forward", "refined", "structure", "fit_unknown_frame"):
        assert 0 < _value(table, method) < 1
        assert 0 < _value(table, method, WHOLE) < 1


def test_what_is_not_there_is_told(made: tuple[Table, list[str]]) -> None:
    table, told = made
    assert table.header["remarks"] == told, told
    assert any("trash_bin_1: trash_bin is not among the categories" in sentence for sentence in told), told
    assert any("chair_2" in sentence and "gone" in sentence for sentence in told), told


def test_scenes_without_their_scan_are_counted(
    layout: Path, packs: dict[str, Path], model: Model, tmp_path: Path
) -> None:
    root = tmp_path / "half"
    shutil.copytree(layout, root)
    scenes = json.loads((root / "full_annotations.json").read_text())
    others = [{**scenes[0], "id_scan": f"scene0002_0{number}"} for number in range(5)]
    (root / "full_annotations.json").write_text(json.dumps([*others, *scenes]))
    told: list[str] = []
    config = TableConfig("scan2cad", top_k=(2,))
    table = make_scan2cad_table([root], {"m": model}, config, source=[packs["chair"]], report=told.append)
    assert len(table.subjects()) == 1
    assert any(sentence.startswith("left out: 5 annotated scenes") for sentence in told), told
    (root / "full_annotations.json").write_text(json.dumps(others))
    with pytest.raises(ScanError, match="5 annotated scenes"):
        make_scan2cad_table([root], {"m": model}, config, source=[packs["chair"]])
    with pytest.raises(ScanError, match=r"full_annotations\.json"):
        make_scan2cad_table([tmp_path], {"m": model}, config, source=[packs["chair"]])
