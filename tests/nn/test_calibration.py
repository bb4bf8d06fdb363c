"""Calibration on disk: it comes back as it was, belongs to its model, and every damage is one sentence."""

import json
from pathlib import Path

import pytest

from kpred.errors import ModelError, OutputError
from kpred.nn import load_model, save_network
from kpred.nn.calibration import CALIBRATION_FILE, Calibration, load_calibration, save_calibration

FOUND = Calibration(("constant", "a", "odds"), (-1.0, 0.5, 2.0), (-2.0, 0.25), {"seed": 3, "packs": ["x.npz"]})


def test_a_calibration_survives_its_file(tmp_path: Path) -> None:
    assert load_calibration(tmp_path) is None
    assert save_calibration(FOUND, tmp_path) == tmp_path / CALIBRATION_FILE
    assert load_calibration(tmp_path) == FOUND
    assert [file.name for file in tmp_path.iterdir()] == [CALIBRATION_FILE]


def test_a_model_has_the_calibration_of_its_folder(small, tmp_path: Path) -> None:
    for category in ("chair", "table"):
        save_network(small(category=category), tmp_path / category)
    assert load_model(tmp_path).calibration is None
    save_calibration(FOUND, tmp_path)
    assert load_model(tmp_path).calibration == FOUND
    assert load_model(tmp_path).categories == ("chair", "table")
    assert load_model(tmp_path / "chair").calibration is None
    save_calibration(FOUND, tmp_path / "chair")
    assert load_model(tmp_path / "chair").calibration == FOUND


@pytest.mark.parametrize(
    "change",
    [
        {"weights": [1.0]},
        {"weights_without_odds": [1.0, 2.0, 3.0]},
        {"weights": [1.0, "x", 2.0]},
        {"weights": None},
        {"made_from": 5},
    ],
    ids=str,
)
def test_damage_is_one_sentence(change: dict, tmp_path: Path) -> None:
    file = save_calibration(FOUND, tmp_path)
    file.write_text(json.dumps({**json.loads(file.read_text()), **change}))
    with pytest.raises(ModelError, match=r"calibration\.json is damaged .*kpred train confidence"):
        load_calibration(tmp_path)


def test_files_that_are_no_calibration(tmp_path: Path) -> None:
    for text in ("", "{", "[]", "{}", json.dumps({"features": ["a"], "weights": [float("nan")]})):
        (tmp_path / CALIBRATION_FILE).write_text(text)
        with pytest.raises(ModelError, match="is damaged"):
            load_calibration(tmp_path)


def test_a_folder_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="cannot be written"):
        save_calibration(FOUND, tmp_path / "none")
