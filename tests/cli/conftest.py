"""Small real files that tests of commands share, and two ways to run a command line."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from kpred.cli.main import FAILED, OK, main
from kpred.nn import ModelConfig, save_network
from kpred.synthetic.generator import generate
from kpred.training.run import new_network

Run = Callable[..., Any]

SCAN_PLACE = np.array([1000.0, 20.0, -300.0])
"""Where the scanned table stands, in centimetres."""


@pytest.fixture(scope="session")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a pack of 8 tables, untrained networks for tables, their database, and a scan of a table."""
    folder = tmp_path_factory.mktemp("files")
    generate("table", 8, seed=1, splits=False).save(folder / "table.npz")
    config = ModelConfig(category="table", width=16, token_size=8, region_points=16, stages=1)
    save_network(new_network(config, seed=0), folder / "model")
    line = ["database", "build", folder / "table.npz", "--model", folder / "model", "-o", folder / "tables.kpred"]
    assert main([str(word) for word in line]) == OK
    table = generate("table", 9, seed=2)[8]
    surface = trimesh.Trimesh(table.vertices, table.faces, process=False)
    points = trimesh.sample.sample_surface(surface, 1500, seed=0)[0] * 100 + SCAN_PLACE
    trimesh.PointCloud(points).export(folder / "scan.ply")
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
        said = [line for line in printed.err.splitlines() if not line.startswith("kpred: note: ")]
        lines = [line for line in said if line.startswith("kpred: ")]
        assert len(lines) == 1
        assert "Traceback" not in printed.err
        assert "unexpected" not in lines[0]
        assert printed.out == ""
        return lines[0]

    return run
