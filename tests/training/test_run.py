"""A whole training: real kills, the order of stages, what is left behind, and the few packages it needs."""

import json
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest
import torch

from kpred.errors import CheckpointError, ConfigError, PackError
from kpred.nn import load_model, load_network, save_network
from kpred.nn.config import SHARED
from kpred.synthetic.generator import generate
from kpred.training.checkpoint import Checkpoint
from kpred.training.config import StageConfig, TrainConfig
from kpred.training.run import new_network, train

# A training in a process of its own, in which only torch, numpy and safetensors (and what they need) can be imported.
_CHILD = textwrap.dedent(
    """
    import os, signal, sys

    absent = {"jaxtyping", "beartype", "scipy", "numba", "trimesh", "sqlalchemy", "tyro", "rich", "pyvista",
              "matplotlib", "huggingface_hub", "tensorboard"}

    class Absent:
        def find_spec(self, name, path=None, target=None):
            if name.partition(".")[0] in absent:
                raise ModuleNotFoundError(f"{name} is absent here", name=name)
            return None

    sys.meta_path.insert(0, Absent())
    import json
    from pathlib import Path
    import torch
    from kpred.nn import ModelConfig
    from kpred.shapes.pack import MeshPack
    from kpred.training.config import StageConfig, TrainConfig
    from kpred.training.run import train

    torch.set_num_threads(1)
    pack, model, settings, stage, step, *folders = sys.argv[1:]
    values = json.loads(settings)
    for name in ("deformation", "retrieval", "partial"):
        values[name] = StageConfig(**values[name])
    values["occlusion"] = tuple(values["occlusion"])
    config = TrainConfig(**values)

    def report(name, done, total, losses):
        if (name, done) == (stage, int(step)):
            os.kill(os.getpid(), signal.SIGKILL)

    for folder in folders:
        train([MeshPack.load(pack)], ModelConfig(**json.loads(model)), config, Path(folder), report=report)
    assert not absent & {name.partition(".")[0] for name in sys.modules}
    print("finished")
    """
)


def _child(pack_file: Path, model, config: TrainConfig, stage: str, step: int, *folders: Path):
    arguments = [pack_file, json.dumps(model.to_dict()), json.dumps(config.to_dict()), stage, step, *folders]
    return subprocess.run(
        [sys.executable, "-c", _CHILD, *map(str, arguments)], capture_output=True, text=True, timeout=300
    )


def test_a_killed_run_ends_as_if_it_had_not_been(tmp_path: Path, pack_file: Path, model_config, train_config) -> None:
    """kill -9 in the second stage, then the rest; all of it without the heavy packages."""
    killed, whole = tmp_path / "killed", tmp_path / "whole"
    done = _child(pack_file, model_config, train_config, "retrieval", 4, killed)
    assert done.returncode == -signal.SIGKILL, done.stderr
    # Killed after the fourth step and before its checkpoint.
    assert Checkpoint.load(killed / "retrieval.checkpoint").step == 2
    assert not (killed / "partial.checkpoint").exists()
    done = _child(pack_file, model_config, train_config, "none", 0, killed, whole)
    assert done.stdout.strip() == "finished", done.stderr
    for stage in ("deformation", "retrieval", "partial"):
        ends = [Checkpoint.load(folder / f"{stage}.checkpoint") for folder in (killed, whole)]
        assert [end.step for end in ends] == [5, 5]
        assert ends[0].weights.keys() == ends[1].weights.keys()
        for key, value in ends[1].weights.items():
            assert torch.equal(ends[0].weights[key], value), f"{stage}: {key}"
    exported = [(folder / "model" / "model.safetensors").read_bytes() for folder in (killed, whole)]
    assert exported[0] == exported[1]


def test_stages_one_by_one_are_as_good_as_all_at_once(tmp_path: Path, pack, model_config, train_config, change) -> None:
    reports: list[tuple[str, int, int]] = []
    together = train(
        [pack], model_config, train_config, tmp_path / "all", report=lambda s, d, t, _: reports.append((s, d, t))
    )
    assert reports == [(s, d, 5) for s in ("deformation", "retrieval", "partial") for d in range(1, 6)]
    for stage in ("deformation", "retrieval", "partial"):
        alone = train([pack], model_config, train_config, tmp_path / "single", stages=[stage])
    for (key, a), b in zip(together.state_dict().items(), alone.state_dict().values(), strict=True):
        assert torch.equal(a, b), key
    assert load_network(tmp_path / "all" / "model").fingerprint() == together.fingerprint()
    record = json.loads((tmp_path / "all" / "model" / "training.json").read_text())
    assert record["shapes"] == {"packs": [4], "sources": 4, "targets": 4}
    assert record["training"]["partial"]["steps"] == 5
    assert record["model"]["category"] == "table"


def test_a_stage_needs_the_one_before(tmp_path: Path, pack, model_config, train_config, change) -> None:
    for stage, missing in (("retrieval", "deformation"), ("partial", "retrieval")):
        with pytest.raises(CheckpointError, match=f"{missing}.checkpoint is missing; train the stage '{missing}'"):
            train([pack], model_config, train_config, tmp_path, stages=[stage])
    assert list(tmp_path.iterdir()) == []
    train([pack], model_config, train_config, tmp_path, stages=["deformation"])
    with pytest.raises(CheckpointError, match="another architecture"):
        train([pack], change(model_config, width=32), train_config, tmp_path, stages=["retrieval"])


def test_impossible_requests(tmp_path: Path, pack, model_config, train_config) -> None:
    with pytest.raises(ConfigError, match="no training stage.*'fine'"):
        train([pack], model_config, train_config, tmp_path, stages=["fine"])
    with pytest.raises(ConfigError, match="leave one out"):
        train([pack], model_config, train_config, tmp_path, stages=["deformation", "partial"])
    with pytest.raises(ConfigError):
        train([pack], model_config, train_config, tmp_path, stages=[])
    with pytest.raises(PackError, match="fewer than two"):
        train([pack], model_config, train_config, tmp_path, source_split="train")
    for wrong in ({"steps": 0}, {"batch": 1}, {"learning_rate": 0.0}):
        with pytest.raises(ConfigError):
            StageConfig(**wrong)
    for wrong in ({"points": 10}, {"occlusion": (0.5, 0.2)}, {"occlusion": (0.1, 1.0)}):
        with pytest.raises(ConfigError):
            TrainConfig(**wrong)


def test_new_networks_leave_the_global_random_state_alone(model_config) -> None:
    torch.manual_seed(9)
    expected = torch.rand(3)
    torch.manual_seed(9)
    a, b, c = (new_network(model_config, seed) for seed in (0, 0, 1))
    assert torch.equal(torch.rand(3), expected)
    assert a.fingerprint() == b.fingerprint() != c.fingerprint()


def test_a_shared_network_goes_on_from_that_of_one_category(
    tmp_path: Path, pack, model_config, train_config, change
) -> None:
    table = new_network(model_config, 3)
    save_network(table, tmp_path / "table", half=False)
    packs = [pack, generate("vase", 2, seed=0, splits=False)]
    stage = StageConfig(steps=1, batch=2, learning_rate=1e-9)
    train(
        packs,
        change(model_config, category=SHARED),
        change(train_config, deformation=stage),
        tmp_path / "run",
        stages=("deformation",),
        start_from=tmp_path / "table",
    )
    found = load_model(tmp_path / "run" / "model")["sofa"]
    for before, after in zip(table.parameters(), found.parameters(), strict=True):
        torch.testing.assert_close(before, after, rtol=1e-3, atol=1e-3)  # stored in half precision
    record = json.loads((tmp_path / "run" / "model" / "training.json").read_text())
    assert record["shapes"]["categories"] == ["table", "vase"]
