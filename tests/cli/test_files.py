"""Commands on real files, small ones: what they write, what they print, how they refuse."""

import errno
import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from kpred.shapes.pack import MeshPack
from kpred.synthetic.generator import generate

Run = Callable[..., Any]


def test_data_generate_and_info_agree(tmp_path: Path, run_json: Run) -> None:
    pack = tmp_path / "chair.npz"
    made = run_json("data", "generate", "chair", "-n", 10, "--seed", 3, "-o", pack)
    assert made == run_json("data", "info", pack)
    assert made[0]["shapes"] == 10
    assert sum(made[0]["splits"].values()) == 10
    assert list(MeshPack.load(pack).model_id) == list(generate("chair", 10, seed=3).model_id)


def test_a_database_is_built_added_to_and_taken_from(files: Path, tmp_path: Path, run_json: Run) -> None:
    database, model = tmp_path / "tables.kpred", files / "model"
    half = tmp_path / "table.npz"
    generate("table", 4, seed=1, splits=False).save(half)
    built = run_json("database", "build", half, "--model", model, "-o", database)
    assert (built["added"], built["present"], built["left_out"]) == (4, 0, [])
    added = run_json("database", "add", database, files / "table.npz", "--model", model)
    assert (added["added"], added["present"]) == (4, 4)
    info = run_json("database", "info", database, "--ids")
    assert info["models"] == len(info["model_ids"]["table"]) == 8
    gone = info["model_ids"]["table"][:2]
    assert run_json("database", "remove", database, *gone)["removed"] == 2
    assert run_json("database", "info", database, "--ids")["model_ids"]["table"] == info["model_ids"]["table"][2:]
    again = run_json("database", "build", half, "--model", model, "-o", database, "--no-resume")
    assert (again["added"], again["present"]) == (4, 0)


def test_training_runs_and_its_weights_make_a_database(files: Path, tmp_path: Path, run_json: Run) -> None:
    small = ["--model.width", 16, "--model.token-size", 8, "--model.region-points", 16, "--model.stages", 1]
    short = [f"--{stage}.steps=2" for stage in ("deformation", "retrieval", "partial")]
    line = ["train", "all", files / "table.npz", "-o", tmp_path / "run", "--points", 128, *small, *short]
    done = run_json(*line, "--threads", 1)
    assert done["category"] == "table"
    assert set(done["last_losses"]) == {"deformation", "retrieval", "partial"}
    assert run_json(*line)["last_losses"] == {}  # all stages are finished: nothing is trained again
    info = run_json("info", "--model", done["model"])
    assert info["model"]["categories"][0]["category"] == "table"
    assert info["model"]["categories"][0]["token_size"] == 8


def test_the_preset_is_where_settings_start(files: Path, tmp_path: Path, run_json: Run) -> None:
    line = ["train", "deformation", files / "table.npz", "-o", tmp_path / "run", "--preset", "kp-red", "--points", 96]
    run_json(*line, "--deformation.steps", 1, "--deformation.batch", 2, "--model.width", 16, "--threads", 1)
    record = json.loads((tmp_path / "run" / "model" / "training.json").read_text())
    assert record["model"]["cage"] == "pulled"
    assert record["model"]["width"] == 16
    assert record["training"]["stretch"] == 1.0
    assert record["training"]["deformation"]["steps"] == 1


def test_fit_writes_a_mesh_in_place_and_a_record(files: Path, tmp_path: Path, run_json: Run) -> None:
    using = ["--model", files / "model", "--database", files / "tables.kpred", "--no-picture"]
    printed = run_json("fit", files / "scan.ply", "-o", tmp_path / "fit.obj", *using)
    assert [Path(file).name for file in printed["files"]] == ["fit.obj", "fit.json"]
    record = json.loads((tmp_path / "fit.json").read_text())
    assert record["category"] == printed["category"] == "table"
    assert record["scan"] == str(files / "scan.ply")
    assert {metric["name"] for metric in record["metrics"]} >= {"mean_scan_to_result"}
    assert all(metric["unit"] and metric["frame"] for metric in record["metrics"])
    mesh, scan = trimesh.load_mesh(tmp_path / "fit.obj"), trimesh.load(files / "scan.ply")
    size = float(np.linalg.norm(scan.extents))
    assert np.linalg.norm(mesh.bounds.mean(axis=0) - scan.bounds.mean(axis=0)) < size / 2
    assert 0.3 < float(np.linalg.norm(mesh.extents)) / size < 3


def test_search_lists_the_nearest_tokens_first(files: Path, run_json: Run) -> None:
    line = ["database", "search", files / "tables.kpred", files / "scan.ply", "--model", files / "model"]
    found = run_json(*line, "--top-k", 4)
    distances = [row["token_distance"] for row in found]
    assert len(distances) == 4
    assert distances == sorted(distances)


def test_evaluate_prints_the_rows_it_writes(files: Path, tmp_path: Path, run_json: Run) -> None:
    line = ["evaluate", files / "table.npz", "--split", "source", "--limit", 2, "--model", files / "model"]
    printed = run_json(*line, "--top-k", 1, 3, "-o", tmp_path / "rows.json")
    assert json.loads((tmp_path / "rows.json").read_text()) == printed
    rows = printed["rows"]
    wanted = {"dataset", "category", "protocol", "method", "model", "metric", "surface", "unit", "top_k", "value", "n"}
    assert all(wanted <= set(row) for row in rows), rows[0]
    assert {row["method"] for row in rows} >= {"undeformed_nearest", "no_learning", "feed_forward", "refined"}
    assert {row["top_k"] for row in rows if row["method"] == "refined"} == {1, 3}


def test_a_full_disk_is_one_sentence_and_leaves_nothing(
    files: Path, tmp_path: Path, refusal: Callable[..., str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*arguments: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("kpred.atomic.os.replace", full)
    using = ["--model", files / "model", "--database", files / "tables.kpred", "--no-picture"]
    sentence = refusal("fit", files / "scan.ply", "-o", tmp_path / "fit.obj", *using)
    assert "fit.obj" in sentence
    assert "No space left on device" in sentence
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("line", "words"),
    [
        (["fit", "{new}/none.ply", "-o", "{new}/a.obj"], "none.ply: there is no such file"),
        (["fit", "{files}/table.txt.gz", "-o", "{new}/a.obj"], "table.txt.gz"),
        (["fit", "{files}/scan.ply", "-o", "{new}/a.step"], "unknown extension '.step'"),
        (["fit", "{files}/scan.ply", "-o", "{new}/none/a.obj"], "none does not exist"),
        (["fit", "{files}/scan.ply", "-o", "{files}/scan.ply"], "it would overwrite the scan"),
        (["fit", "{files}/scan.ply", "-o", "{new}/a.obj", "--model", "{new}/none"], "none"),
        (["fit", "{files}/scan.ply", "-o", "{new}/a.obj", "--database", "{files}/table.npz"], "table.npz"),
        (
            ["fit", "{files}/scan.ply", "-o", "{new}/a.obj", "--model", "{files}/model", "--database"]
            + ["{files}/tables.kpred", "--category", "sofa"],
            "sofa",
        ),
        (["evaluate", "{new}/none.npz", "--model", "{files}/model"], "none.npz"),
        (["evaluate", "{files}/table.npz", "--model", "{files}/model", "--split", "nope"], "nope"),
        (["data", "info", "{new}/none.npz"], "none.npz: there is no such file"),
        (["data", "generate", "spaceship", "-o", "{new}/spaceship.npz"], "spaceship"),
        (["data", "generate", "chair", "-o", "{new}/chair.zip"], "chair.zip"),
        (["data", "generate", "chair", "-n", "2", "-o", "{new}/no/chair.npz"], "no/chair.npz"),
        (["database", "info", "{new}/none.kpred"], "none.kpred does not exist"),
        (["database", "info", "{files}/table.npz"], "table.npz"),
        (["database", "remove", "{new}/none.kpred", "a"], "none.kpred does not exist"),
        (["database", "add", "{new}/none.kpred", "{files}/table.npz"], "there is no such database"),
        (["database", "build", "{new}/none", "-o", "{new}/a.kpred"], "none"),
        (["database", "build", "{files}/table.npz", "--model", "{files}/none", "-o", "{new}/a.kpred"], "none"),
        (
            [
                "database",
                "build",
                "{files}/table.npz",
                "--model",
                "{files}/model",
                "--split",
                "val",
                "-o",
                "{new}/a.kpred",
            ],
            "no shape of that category and split",
        ),
        (["train", "retrieval", "{files}/table.npz", "-o", "{new}/run"], "deformation"),
        (["train", "all", "{files}/table.npz", "--model.category", "chair", "-o", "{new}/run"], "chair, table"),
        (["train", "all", "{files}/table.npz", "--device", "cuda:77", "-o", "{new}/run"], "cuda:77"),
        (["train", "all", "{new}/none.npz", "-o", "{new}/run"], "none.npz"),
    ],
)
def test_refusals_name_the_file_and_write_nothing(
    line: list[str], words: str, files: Path, tmp_path: Path, refusal: Callable[..., str]
) -> None:
    assert words in refusal(*(word.format(files=files, new=tmp_path) for word in line))
    assert not list(tmp_path.iterdir())
