"""`kpred train confidence`: what it writes into the model's folder, and what it refuses."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from kpred.cli.main import FAILED, USAGE, main
from kpred.nn import Recognizer, RecognizerConfig, load_model, save_recognizer

Run = Callable[..., Any]


@pytest.fixture
def folder(files: Path, tmp_path: Path) -> Path:
    """A model of its own, since it gets a file."""
    return Path(shutil.copytree(files / "model", tmp_path / "model"))


def _samples(file: Path, right: bool | None = None) -> Path:
    rng, rows = np.random.default_rng(0), []
    for _ in range(60):
        odds = float(rng.normal(0, 3))
        evidence = {"error": 0.05, "unexplained": 0.1, "seen": 0.8, "category": 0.9, "turn": 0.9, "box": 0.05}
        outcome = bool(odds > 0) if right is None else right
        rows.append({"category": "table", "kind": "views", "right": outcome, "evidence": {**evidence, "odds": odds}})
    file.write_text(json.dumps({"samples": rows}))
    return file


def test_the_calibration_goes_into_the_models_folder(files: Path, folder: Path, tmp_path: Path, run_json: Run) -> None:
    samples = _samples(tmp_path / "samples.json")
    report = run_json("train", "confidence", files / "table.npz", "--model", folder, "--samples", samples)
    assert report["file"] == str(folder / "calibration.json")
    found = load_model(folder).calibration
    assert found is not None
    assert list(found.weights) == report["calibration"]["weights"]
    assert found.weights[-1] > 0.3
    assert found.made_from["samples"] == 60
    assert found.made_from["packs"][0]["file"] == "table.npz"
    assert report["held_out"]["with odds"]["auc"] > 0.9


def test_a_database_of_the_shared_recognizer_has_a_calibration_of_its_own(
    files: Path, folder: Path, tmp_path: Path, run_json: Run
) -> None:
    torch.manual_seed(0)
    several = tmp_path / "several"
    shutil.copytree(folder, several / "table")
    save_recognizer(Recognizer(RecognizerConfig(("lamp", "table"), width=8)), several / "recognizer_any")
    samples = _samples(tmp_path / "samples.json")
    line = ("train", "confidence", files / "table.npz", "--model", several, "--samples", samples)
    report = run_json(*line, "--database", files / "tables.kpred")
    assert report["file"] == str(several / "recognizer_any" / "calibration.json")
    found = load_model(several)
    assert found.calibration is None
    assert found.shared_calibration is not None
    assert found.calibration_of(["table"]) == found.shared_calibration


def test_new_samples_are_kept(files: Path, folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    kept = tmp_path / "kept.json"
    using = ["--model", str(folder), "--database", str(files / "tables.kpred"), "--limit", "2", "--split", "source"]
    line = ["train", "confidence", str(files / "table.npz"), *using, "--top-k", "1", "--samples", str(kept)]
    # Two fits are too few to calibrate on, and are kept for all that.
    assert main(line) == FAILED
    assert "cannot be calibrated on" in capsys.readouterr().err
    assert len(json.loads(kept.read_text())["samples"]) <= 2
    assert not (folder / "calibration.json").exists()


@pytest.mark.parametrize(
    ("words", "code", "sentence"),
    [
        ("", USAGE, "no pack was named"),
        ("{pack}", USAGE, "no model was named"),
        ("{pack} --model {new}/none", FAILED, "no model folder"),
        ("{pack} --model {model} --samples {new}/broken.json", FAILED, "holds no samples"),
        ("{pack} --model {model} --samples {new}/right.json", FAILED, "both right and wrong ones"),
        ("{new}/none.npz --model {model} --database {files}/tables.kpred", FAILED, "there is no such file"),
    ],
)
def test_refusals(
    words: str, code: int, sentence: str, files: Path, folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "broken.json").write_text("{}")
    _samples(tmp_path / "right.json", right=True)
    places = {"pack": files / "table.npz", "new": tmp_path, "model": folder, "files": files}
    assert main(["train", "confidence", *(word.format(**places) for word in words.split())]) == code
    printed = capsys.readouterr()
    assert sentence in printed.err
    assert "Traceback" not in printed.err
    assert not (folder / "calibration.json").exists()
