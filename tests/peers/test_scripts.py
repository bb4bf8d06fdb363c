"""Scripts that train peers: their settings are valid, and a training is measured at the steps asked for."""

import csv
from pathlib import Path
from types import ModuleType

import pytest

from kpred.peers.networks import PEERS
from kpred.shapes.pack import MeshPack
from kpred.synthetic.generator import generate


@pytest.fixture(scope="module")
def scripts() -> dict[str, ModuleType]:
    names = ("train_peers_within", "measure_peer_curve")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(Path(__file__).parents[2] / "scripts")
        return {name: __import__(name) for name in names}


def test_every_peer_has_valid_settings(scripts: dict[str, ModuleType]) -> None:
    settings = scripts["train_peers_within"].SETTINGS
    assert set(settings) == set(scripts["measure_peer_curve"].TRAININGS) == set(PEERS)
    assert all(isinstance(config.points, int) and config.optimisation.batch > 8 for config in settings.values())


def test_a_curve_has_a_row_for_each_measurement(
    scripts: dict[str, ModuleType], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shapes = generate("table", 8, seed=4, splits=False)
    pack = MeshPack.from_meshes(
        list(shapes), list(shapes.model_id), ["source"] * 4 + ["train"] * 2 + ["val"] * 2, "table"
    )
    pack.save(tmp_path / "table.npz")
    words = ["u-red", str(tmp_path / "table.npz"), "-o", str(tmp_path / "run"), "--steps", "3", "--batch", "2"]
    words += ["--points", "96", "--every", "2", "--count", "1", "--network", "parts=8", "width=16", "rounds=1"]
    monkeypatch.setattr("sys.argv", ["measure_peer_curve.py", *words, "--training", "sources=2", "decoded_points=8"])
    scripts["measure_peer_curve"].main()
    with (tmp_path / "run" / "curve.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert [row["step"] for row in rows] == ["2", "3"]
    assert all(float(row[name]) > 0 for row in rows for name in row if name != "seconds")
    assert rows[0]["train_undeformed"] == rows[1]["train_undeformed"]
    assert (tmp_path / "run" / "model" / "model.safetensors").exists()
