"""Checkpoints: round trip, atomic writing, refusal of what is no checkpoint."""

import pickle
from pathlib import Path

import pytest
import torch

from kpred.errors import CheckpointError, OutputError
from kpred.training.checkpoint import VERSION, Checkpoint


@pytest.fixture
def checkpoint() -> Checkpoint:
    return Checkpoint(
        stage="partial",
        step=7,
        model_config={"width": 16, "category": "chair"},
        train_config={"occlusion": (0.25, 0.9), "deformation": {"steps": 3}},
        weights={"layer.weight": torch.randn(40, 30)},
        optimizer={"state": {0: {"step": torch.tensor(3.0), "exp_avg": torch.randn(4)}}, "param_groups": [{"lr": 0.1}]},
        random_state=torch.Generator().manual_seed(3).get_state(),
    )


def test_round_trip(checkpoint: Checkpoint, tmp_path: Path) -> None:
    path = tmp_path / "new" / "folder" / "partial.checkpoint"
    checkpoint.save(path)
    found = Checkpoint.load(path)
    assert (found.stage, found.step) == ("partial", 7)
    assert found.model_config == checkpoint.model_config
    assert found.train_config == checkpoint.train_config
    assert torch.equal(found.weights["layer.weight"], checkpoint.weights["layer.weight"])
    assert torch.equal(found.random_state, checkpoint.random_state)
    assert found.optimizer["param_groups"] == checkpoint.optimizer["param_groups"]
    assert torch.equal(found.optimizer["state"][0]["exp_avg"], checkpoint.optimizer["state"][0]["exp_avg"])
    assert [p.name for p in path.parent.iterdir()] == [path.name]


@pytest.mark.parametrize("fraction", [0.0, 0.01, 0.5, 0.99])
def test_a_truncated_file_is_refused(checkpoint: Checkpoint, tmp_path: Path, fraction: float) -> None:
    path = tmp_path / "partial.checkpoint"
    checkpoint.save(path)
    whole = path.read_bytes()
    path.write_bytes(whole[: int(fraction * len(whole))])
    with pytest.raises(CheckpointError, match="truncated") as caught:
        Checkpoint.load(path)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize(
    "foreign",
    [
        b"just some text\n" * 20,
        bytes(range(256)) * 10,
        pickle.dumps({"version": VERSION}, protocol=2),
        pickle.dumps(Path("x"), protocol=2),
    ],
    ids=["text", "bytes", "pickle", "pickled class"],
)
def test_foreign_bytes_are_refused(tmp_path: Path, foreign: bytes) -> None:
    path = tmp_path / "partial.checkpoint"
    path.write_bytes(foreign)
    with pytest.raises(CheckpointError, match="delete it"):
        Checkpoint.load(path)


@pytest.mark.parametrize(
    "values", [{}, [1], {"version": VERSION}, {"version": VERSION + 1}, {"version": VERSION, "a": 1}]
)
def test_files_of_torch_that_are_no_checkpoint_are_refused(tmp_path: Path, values: object) -> None:
    path = tmp_path / "partial.checkpoint"
    torch.save(values, path)
    with pytest.raises(CheckpointError, match="version of kpred"):
        Checkpoint.load(path)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(CheckpointError, match=f"no checkpoint {tmp_path / 'x'}"):
        Checkpoint.load(tmp_path / "x")


@pytest.mark.parametrize("failing", ["torch.save", "os.replace"])
def test_a_full_disk_leaves_the_old_checkpoint(checkpoint, tmp_path: Path, monkeypatch, failing: str) -> None:
    path = tmp_path / "partial.checkpoint"
    checkpoint.save(path)
    before = path.read_bytes()

    def full(*_args: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(failing, full)
    with pytest.raises(OutputError, match="No space left"):
        checkpoint.save(path)
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == [path.name]
