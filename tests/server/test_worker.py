"""The worker: files as a local fit writes them, and one sentence for all that goes wrong."""

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import kpred
from kpred.errors import ConfigError
from kpred.fitting import pipeline
from kpred.fitting.defaults import resolve_database, resolve_model
from kpred.preprocessing.config import CleanConfig
from kpred.refinement.structure_config import StructureConfig
from kpred.reports.fit_files import write_files
from kpred.server.job import FitAnswer, FitJob
from kpred.server.worker import answer, fit_options

OPTIONS = {"category": "chair", "up": "y", "top_k": 2, "deform": "none", "refinement": None, "structure": None}


def ask(folder: Path, name: str = "scan.ply", **more: Any) -> FitAnswer:
    job = FitJob(str(folder), name, "my chair.ply", "out.obj", OPTIONS | more)
    return answer(job, resolve_model(None), resolve_database(None))


def test_files_are_those_of_a_local_fit(tmp_path: Path) -> None:
    shutil.copy(kpred.sample_scan(), tmp_path / "scan.ply")
    found = ask(tmp_path)
    assert not found.error and list(found.files)[0] == "out.obj"
    scan = kpred.read_scan(kpred.sample_scan())
    local = kpred.fit(scan, category="chair", up="y", top_k=2, deform="none")
    here = tmp_path / "here"
    here.mkdir()
    for file in write_files(local, scan, here / "out.obj", scan_path=kpred.sample_scan(), picture=False).files:
        if file.suffix != ".json":
            assert found.files[file.name] == file.read_bytes(), file.name
    record = json.loads(found.files["out.json"])
    assert (record["scan"], record["mesh"], record["input"]["path"]) == ("my chair.ply", "out.obj", "my chair.ply")
    assert str(tmp_path) not in found.files["out.json"].decode()


def test_errors_and_notes_name_the_scan_as_the_user_does(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "scan.ply").write_text("ply\nnothing")
    found = ask(tmp_path)
    assert found.kind == "ScanError" and found.error.startswith("my chair.ply: ")
    assert str(tmp_path) not in found.error

    def broken(*_: Any, **__: Any) -> None:
        raise RuntimeError(f"cannot use {tmp_path}/scan.npy")

    points = np.concatenate([kpred.read_scan(kpred.sample_scan())[:500], np.full((600, 3), np.nan)])
    np.save(tmp_path / "scan.npy", points)
    shutil.rmtree(tmp_path / "results")
    found = ask(tmp_path, "scan.npy")
    assert len(found.notes) == 1 and found.notes[0].startswith("my chair.ply: 600 of 1100 points are NaN")
    shutil.rmtree(tmp_path / "results")
    monkeypatch.setattr(pipeline, "fit", broken)
    found = ask(tmp_path, "scan.npy")
    assert (found.kind, found.error) == ("Unexpected", "unexpected RuntimeError: cannot use my chair.ply")


def test_settings_become_what_a_fit_takes() -> None:
    found = fit_options(
        {"clean": {"wall": False}, "structure": {"contact": 0.5}, "refinement": None, "sensor": [1, 2, 3]}
    )
    assert found["clean"] == CleanConfig(wall=False) and found["structure"] == StructureConfig(contact=0.5)
    np.testing.assert_array_equal(found["sensor"], [1.0, 2.0, 3.0])
    with pytest.raises(ConfigError, match="structure: its settings"):
        fit_options({"structure": {"nothing": 1}})
