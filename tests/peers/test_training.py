"""Peers: training falls, resumes exactly, is refused where it cannot be, and its weights come back as they were."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from kpred.errors import CheckpointError, ModelError, PackError
from kpred.peers.networks import (
    PEERS,
    KeypointDeformerConfig,
    NeuralCagesConfig,
    ShapeFlowConfig,
    URedConfig,
    Uy2021Config,
    load_peer,
    load_peers,
)
from kpred.peers.training.config import (
    KeypointDeformerTraining,
    NeuralCagesTraining,
    ShapeFlowTraining,
    URedTraining,
    Uy2021Training,
)
from kpred.peers.training.part_sources import read_part_sources
from kpred.peers.training.run import keep, prepare_peer, train_peer
from kpred.peers.training.standardise import standardise
from kpred.shapes.pack import MeshPack
from kpred.synthetic.generator import generate
from kpred.training.checkpoint import Checkpoint
from kpred.training.config import StageConfig

SHORT = StageConfig(steps=5, batch=2)
FEW = {"optimisation": SHORT, "points": 96, "checkpoint_every": 2}
SMALL = {
    "keypoint-deformer": (KeypointDeformerConfig(), KeypointDeformerTraining(**FEW, warmup=2)),
    "neural-cages": (NeuralCagesConfig(code_size=128), NeuralCagesTraining(**FEW)),
    "uy2021": (Uy2021Config(parts=8, code_size=16), Uy2021Training(**FEW, warmup=2, candidates=3)),
    "u-red": (URedConfig(parts=8, width=16, rounds=1), URedTraining(**FEW)),
    "shapeflow": (ShapeFlowConfig(width=32), ShapeFlowTraining(**FEW)),
}


class Stopped(Exception):
    pass


@pytest.fixture(scope="module")
def packs() -> list[MeshPack]:
    """Six tables, of which four are sources."""
    tables = generate("table", 6, seed=3, splits=False)
    return [MeshPack.from_meshes(list(tables), list(tables.model_id), ["source"] * 4 + ["train"] * 2, "table")]


def _train(peer: str, packs: list[MeshPack], folder: Path, **options) -> torch.nn.Module:
    model, config = SMALL[peer]
    return train_peer(packs, model, replace(config, **options.pop("change", {})), folder, **options)


EVERY = pytest.mark.parametrize("peer", list(PEERS))


@EVERY
def test_resumed_equals_uninterrupted_and_weights_come_back(peer: str, packs: list[MeshPack], tmp_path: Path) -> None:
    whole = _train(peer, packs, tmp_path / "whole").state_dict()

    def stop(_stage: str, done: int, _total: int, _losses: dict[str, float]) -> None:
        if done == 3:
            raise Stopped

    with pytest.raises(Stopped):
        _train(peer, packs, tmp_path / "cut", report=stop)
    assert Checkpoint.load(tmp_path / "cut" / f"{peer}.checkpoint").step == 2
    resumed = _train(peer, packs, tmp_path / "cut").state_dict()
    assert whole.keys() == resumed.keys()
    assert all(torch.equal(whole[key], resumed[key]) for key in whole)
    found = load_peers(tmp_path / "cut")["table"]
    for key, value in found.state_dict().items():
        torch.testing.assert_close(value, whole[key].half().float(), rtol=0, atol=0)
    assert (tmp_path / "cut" / "model" / "training.json").exists()


@EVERY
def test_the_deformation_error_falls(peer: str, packs: list[MeshPack], tmp_path: Path) -> None:
    seen: list[dict[str, float]] = []
    settings = StageConfig(steps=40, batch=4, learning_rate=3e-3)
    change = {"optimisation": settings, "checkpoint_every": 100}
    if hasattr(SMALL[peer][1], "warmup"):
        change["warmup"] = 5
    _train(
        peer,
        packs,
        tmp_path,
        change=change,
        report=lambda _stage, _done, _total, losses: seen.append(losses),
    )
    name = "deformation" if peer == "uy2021" else "similarity"
    values = [losses[name] for losses in seen if name in losses]
    assert sum(values[-8:]) < 0.9 * sum(values[:8])


@EVERY
def test_refusals(peer: str, packs: list[MeshPack], tmp_path: Path) -> None:
    _train(peer, packs, tmp_path / "run")
    with pytest.raises(CheckpointError, match="other settings"):
        _train(peer, packs, tmp_path / "run", change={"seed": 1})
    chairs = generate("chair", 3, seed=0, splits=False)
    with pytest.raises(PackError, match="one category"):
        _train(peer, [*packs, chairs], tmp_path / "mixed")
    weights = tmp_path / "run" / "model" / "model.safetensors"
    whole = weights.read_bytes()
    weights.write_bytes(whole[:100])
    with pytest.raises(ModelError, match=r"model\.safetensors"):
        load_peers(tmp_path / "run")
    weights.write_bytes(whole)
    config = tmp_path / "run" / "model" / "config.json"
    config.write_text('{"peer": "nobody"}')
    with pytest.raises(ModelError, match=r"config\.json"):
        load_peer(config.parent)
    with pytest.raises(ModelError, match="no weights of a peer"):
        load_peers(tmp_path / "run")


def test_a_training_that_was_stopped_says_so(packs: list[MeshPack], tmp_path: Path) -> None:
    model, config = SMALL["neural-cages"]
    prepared = prepare_peer(packs, model, config)
    keep(prepared, config, tmp_path, steps=3)
    assert load_peers(tmp_path)["table"].config.code_size == model.code_size
    assert json.loads((tmp_path / "model" / "training.json").read_text())["stopped_after"] == 3
    _train("neural-cages", packs, tmp_path)
    assert "stopped_after" not in json.loads((tmp_path / "model" / "training.json").read_text())


def test_uy_deforms_only_what_it_was_trained_on(packs: list[MeshPack], tmp_path: Path) -> None:
    network = _train("uy2021", packs, tmp_path)
    names = tuple(str(name) for name in packs[0].model_id)
    assert network.rows(names[:4]).tolist() == [0, 1, 2, 3]
    with pytest.raises(ModelError, match="2 of 6 sources were not in the training"):
        network.rows(names)


def test_shapeflow_knows_all_shapes_of_its_training(packs: list[MeshPack], tmp_path: Path) -> None:
    network = _train("shapeflow", packs, tmp_path)
    names = tuple(str(name) for name in packs[0].model_id)
    assert network.rows(names).tolist() == [0, 1, 2, 3, 4, 5]
    with pytest.raises(ModelError, match="1 of 2 sources were not in the training"):
        network.rows((names[0], "nobody"))


def test_sources_need_names_of_their_own(packs: list[MeshPack], tmp_path: Path) -> None:
    with pytest.raises(PackError, match="are called"):
        read_part_sources([*packs, *packs], 8, 0)
    with pytest.raises(PackError, match="are called"):
        train_peer([*packs, *packs], *SMALL["shapeflow"], tmp_path)
    with pytest.raises(PackError, match="fewer than two shapes"):
        read_part_sources(packs, 8, 0, split="val")


@pytest.mark.parametrize("peer", ["u-red", "uy2021"])
def test_before_the_first_step_codes_tell_shapes_apart(peer: str, packs: list[MeshPack]) -> None:
    """Else all sources are deformed to one mean shape: without a norm, every cloud has nearly the same maximum."""
    model, config = SMALL[peer]
    prepared = prepare_peer(packs, model, config)
    stage = prepared.stage(config)
    encoder = prepared.network.whole.encoder if peer == "u-red" else prepared.network.target_encoder
    clouds = stage.data.clouds(stage.data.targets, 96, torch.Generator().manual_seed(0))

    def apart() -> float:
        codes = encoder(clouds).detach()
        return float(codes.std(0).mean() / codes.norm(dim=1).mean())

    before = apart()
    stage.start()
    assert apart() > 2 * before


def test_layers_are_scaled_by_what_they_say(generator: torch.Generator) -> None:
    first, second = torch.nn.Linear(4, 8), torch.nn.Linear(8, 5, bias=False)
    data = 3 + 0.1 * torch.randn(500, 4, generator=generator)
    standardise([first, second], lambda: second(first(data)))
    said = first(data)
    torch.testing.assert_close(said.mean(0), torch.zeros(8), atol=1e-4, rtol=0)
    torch.testing.assert_close(said.std(0), torch.ones(8), atol=1e-3, rtol=0)
    torch.testing.assert_close(second(said).std(0), torch.ones(5), atol=1e-3, rtol=0)
    again = first.weight.clone()
    first(100 * data)  # only once
    assert torch.equal(first.weight, again)


def test_training_needs_only_torch_numpy_and_safetensors() -> None:
    """As the package's own training; `tests/test_light_imports.py` shows that the blocker blocks."""
    code = (
        "import sys\n"
        "class Hide:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        if name.partition('.')[0] in 'trimesh scipy numba sqlalchemy jaxtyping rich tyro'.split():\n"
        "            raise ModuleNotFoundError(name, name=name)\n"
        "sys.meta_path.insert(0, Hide())\n"
        "import kpred.peers.training.run\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
