"""Commands on real files, small ones: what they write, what they print, how they refuse."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from kpred.cli.main import FAILED, OK, main
from kpred.nn import ModelConfig, save_network
from kpred.shapes.pack import MeshPack
from kpred.shapes.synthetic.generator import generate
from kpred.training.run import new_network

Run = Callable[..., Any]


@pytest.fixture(scope="session")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a pack of 8 tables and untrained networks for tables."""
    folder = tmp_path_factory.mktemp("files")
    generate("table", 8, seed=1, splits=False).save(folder / "table.npz")
    config = ModelConfig(category="table", width=16, token_size=8, region_points=16, stages=1)
    save_network(new_network(config, seed=0), folder / "model")
    return folder


@pytest.fixture
def run_json(capsys: pytest.CaptureFixture[str]) -> Run:
    """Runs a command line with --json and returns what standard output holds, which must be JSON and nothing else."""

    def run(*words: object) -> Any:
        assert main([*map(str, words), "--json"]) == OK, capsys.readouterr().err
        return json.loads(capsys.readouterr().out)

    return run


@pytest.fixture
def refusal(capsys: pytest.CaptureFixture[str]) -> Callable[..., str]:
    """Runs a command line that must fail, and returns its one sentence."""

    def run(*words: object) -> str:
        assert main([*map(str, words)]) == FAILED
        printed = capsys.readouterr()
        lines = [line for line in printed.err.splitlines() if line.startswith("kpred: ")]
        assert len(lines) == 1
        assert "Traceback" not in printed.err
        assert "unexpected" not in lines[0]
        assert printed.out == ""
        return lines[0]

    return run


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


@pytest.mark.parametrize(
    ("line", "words"),
    [
        (["data", "info", "{new}/none.npz"], "none.npz: there is no such file"),
        (["data", "generate", "sofa", "-o", "{new}/sofa.npz"], "sofa"),
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
