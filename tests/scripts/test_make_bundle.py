"""The bundle's weights: copied from runs as they are, with what they were trained on and calibrated by."""

import json
import shutil
from pathlib import Path

import pytest
from make_bundle import FIRST_RECORD, copy_weights, update_card

from kpred.nn import load_model, load_network
from kpred.nn.fingerprint import weights_fingerprint
from kpred.nn.loading import bundled_model_path


@pytest.fixture
def runs(tmp_path: Path) -> Path:
    """Runs that would make the bundled model: each of its networks as KEY/model."""
    bundled, folder = bundled_model_path(), tmp_path / "runs"
    for config in bundled.rglob("config.json"):
        name = config.parent.relative_to(bundled)
        (folder / name / "model").mkdir(parents=True)
        for file in config.parent.iterdir():
            if file.is_file() and file.name != "calibration.json":
                shutil.copy(file, folder / name / "model" / file.name)
    for file in bundled.rglob("calibration.json"):
        shutil.copy(file, folder / file.relative_to(bundled))
    return folder


def test_the_bundled_model_can_be_made_again(runs: Path, tmp_path: Path) -> None:
    made = tmp_path / "made"
    copy_weights(runs, made, tmp_path / "paper")
    assert weights_fingerprint(load_model(made)) == weights_fingerprint(load_model())
    assert json.loads((made / "any" / "training.json").read_text())["stages"] == ["deformation", "retrieval", "partial"]


def test_the_record_of_the_first_training_comes_with_that_of_the_second(runs: Path, tmp_path: Path) -> None:
    first, record = tmp_path / "first", runs / "any" / "model" / "training.json"
    first.mkdir()
    (first / "training.json").write_text("{}")
    record.write_text(json.dumps({"start_from": str(first), "seed": 4}))
    copy_weights(runs, tmp_path / "made", tmp_path / "paper")
    assert (tmp_path / "made" / "any" / FIRST_RECORD).read_text() == "{}"
    assert str(tmp_path) not in (tmp_path / "made" / "any" / "training.json").read_text()


def test_facts_of_a_card_are_brought_up_to_date(runs: Path) -> None:
    folder = runs / "any" / "model"
    right = (folder / "README.md").read_text()
    wrong = right.replace("| parameters | ", "| parameters | 7").replace("| fingerprint | `", "| fingerprint | `0")
    (folder / "README.md").write_text(wrong)
    update_card(folder, load_network(folder))
    assert (folder / "README.md").read_text() == right
