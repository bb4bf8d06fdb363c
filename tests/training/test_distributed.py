"""Training in two real processes: one mean gradient, one set of weights, and one end whatever happens to either."""

import json
import os
import pickle
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import torch

from kpred.errors import CheckpointError
from kpred.nn import load_network
from kpred.training.checkpoint import Checkpoint
from kpred.training.distributed import SINGLE, World
from kpred.training.loop import train_stage
from kpred.training.losses import DeformationStage
from kpred.training.run import new_network

WORKER = Path(__file__).with_name("joined_worker.py")
STEPS = 5


def _together(folder: Path, jobs: list[dict[str, Any]], dies: bool = False) -> dict[str, list[dict[str, Any] | None]]:
    """What became of each job in each of two processes; None where it died."""
    file = folder / f"jobs-{jobs[0]['name']}"
    file.write_bytes(pickle.dumps(jobs))
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    processes = [
        subprocess.Popen([sys.executable, str(WORKER), str(file), str(rank), "2"], env=environment, stderr=-1)
        for rank in range(2)
    ]
    errors = [process.communicate(timeout=240)[1].decode() for process in processes]
    assert dies or [process.returncode for process in processes] == [0, 0], errors
    found = {}
    for job in jobs:
        files = [Path(f"{file}.{job['name']}.{rank}") for rank in range(2)]
        found[job["name"]] = [pickle.loads(one.read_bytes()) if one.exists() else None for one in files]
    return found


@pytest.fixture(scope="module")
def weights(model_config) -> dict[str, torch.Tensor]:
    """Perturbed, so that gradients reach what lies before zero-initialised heads."""
    generator = torch.Generator().manual_seed(1)
    fresh = new_network(model_config, 0).state_dict()
    return {
        k: v + 0.02 * torch.randn(v.shape, generator=generator) if v.is_floating_point() else v
        for k, v in fresh.items()
    }


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("together")


@pytest.fixture(scope="module")
def job(place: Path, data, model_config, train_config, weights):
    """A training of two processes, in which something may go wrong in the second."""

    def made(name: str, trouble: str = "", whose: int = 1, folder: str = "") -> dict[str, Any]:
        return {
            "name": name, "trouble": trouble, "whose": whose, "folder": str(place / (folder or name)),
            "data": data, "model": model_config, "train": train_config, "weights": weights,
        }  # fmt: skip

    return made


@pytest.fixture(scope="module")
def found(place: Path, job) -> dict[str, Any]:
    """Several trainings, one after the other, in two processes; in the last one dies, and two others go on."""
    first = [
        job("step"), job("whole"), job("wild", "wild"), job("error", "error"), job("first", "error", whose=0),
        job("interrupt", "interrupt"), job("again", folder="interrupt"), job("kill", "kill"),
    ]  # fmt: skip
    answers = _together(place, first, dies=True)
    return answers | _together(place, [job("resumed", folder="kill")])


def _weights(answers: dict[str, Any], name: str) -> list[dict[str, torch.Tensor]]:
    assert all("weights" in answer for answer in answers[name]), answers[name]
    return [answer["weights"] for answer in answers[name]]


def _equal(a: dict[str, torch.Tensor], b: dict[str, torch.Tensor]) -> bool:
    return a.keys() == b.keys() and all(torch.equal(a[key], b[key]) for key in a)


def test_the_gradient_is_the_mean_over_all_batches(found, data, model_config, train_config, weights) -> None:
    network = new_network(model_config, 0)
    network.load_state_dict(weights)
    work = DeformationStage(network, data, train_config)
    seeds = [World(rank, 2).seed(7) for rank in range(2)]
    assert seeds[0] == 7 != seeds[1]
    alone = []
    for seed in seeds:
        network.zero_grad(set_to_none=True)
        torch.stack(list(work.losses(3, torch.Generator().manual_seed(seed)).values())).sum().backward()
        alone.append([p.grad.clone() if p.grad is not None else None for p in work.parameters()])
    assert any(a is not None and not torch.allclose(a, b) for a, b in zip(*alone, strict=True))
    for answer in found["step"]:
        for mean, a, b in zip(answer["gradients"], *alone, strict=True):
            if a is None:
                assert mean is None
            else:
                torch.testing.assert_close(mean, (a + b) / 2, rtol=1e-5, atol=1e-7)


def test_the_first_process_s_data_is_everyone_s_to_the_bit(found, data) -> None:
    for answer in found["step"]:
        for name in ("pool", "sources", "targets", "points", "cages", "weights"):
            assert torch.equal(getattr(answer["data"], name), getattr(data, name)), name


def test_weights_stay_the_same_everywhere(found, place: Path, data, model_config, train_config) -> None:
    first, second = _weights(found, "whole")
    assert _equal(first, second)
    assert [answer["steps"] for answer in found["whole"]] == [list(range(1, STEPS + 1)), []]
    exported = load_network(place / "whole" / "model").state_dict()
    for key, value in exported.items():
        torch.testing.assert_close(value, first[key].half().float(), rtol=0, atol=0)
    # One process sees other batches, and gets elsewhere.
    network = new_network(model_config, 0)
    train_stage(network, data, train_config, "deformation", place / "alone", log=False)
    assert not _equal(network.state_dict(), first)


def test_a_wild_batch_of_one_is_skipped_by_all(found) -> None:
    first, second = _weights(found, "wild")
    assert _equal(first, second)
    assert all(torch.isfinite(value).all() for value in first.values())
    assert not _equal(first, _weights(found, "whole")[0])


def test_an_error_of_one_ends_all_and_is_told_once(found) -> None:
    assert found["error"][1]["error"] == "ValueError: this batch is broken"
    assert found["error"][0]["stopped"] == "OtherProcessFailedError: Another process of this training failed."
    assert "stopped" not in found["error"][1]
    assert "error" not in found["error"][0]
    assert "error" in found["first"][0]
    assert "stopped" in found["first"][1]


def test_an_interrupt_of_one_stops_all_after_the_same_step(found) -> None:
    assert [answer["error"].partition(":")[0] for answer in found["interrupt"]] == ["StopAllProcesses"] * 2
    for weights in _weights(found, "again"):
        assert _equal(weights, _weights(found, "whole")[0])
    assert found["again"][0]["steps"] == [4, 5], "the interrupt did not save the step that was done"


def test_killed_and_resumed_is_as_if_it_had_not_been(found) -> None:
    survivor, dead = found["kill"]
    assert dead is None
    assert survivor["stopped"].startswith("ProcessLostError: Another process of this training died")
    assert found["resumed"][0]["steps"] == [3, 4, 5]
    for weights in _weights(found, "resumed"):
        assert _equal(weights, _weights(found, "whole")[0])


@pytest.mark.skipif(sys.platform != "linux", reason="names of threads are read from /proc")
def test_no_thread_outlives_the_meeting(found) -> None:
    answers = [answer for pair in found.values() for answer in pair if answer is not None]
    assert all(answer["threads"] for answer in answers)
    assert [name for answer in answers for name in answer["threads"] if "gloo" in name] == []


def test_another_number_of_processes_is_refused(found, place: Path, data, model_config, train_config) -> None:
    checkpoint = Checkpoint.load(place / "whole" / "deformation.checkpoint")
    assert checkpoint.random_state.shape[0] == 2
    assert not torch.equal(*checkpoint.random_state)
    with pytest.raises(CheckpointError, match="written by 2 processes, and this training has 1.*nproc-per-node 2"):
        train_stage(new_network(model_config, 0), data, train_config, "deformation", place / "whole", log=False)
    with pytest.raises(CheckpointError, match="written by 1 processes"):
        World(0, 2).check_states(torch.zeros(5, dtype=torch.uint8), "a checkpoint")


def test_one_process_alone_is_left_as_it_is() -> None:
    state, gradient = torch.Generator().get_state(), torch.ones(3)
    parameter = torch.nn.Parameter(torch.zeros(3))
    parameter.grad = gradient
    SINGLE.agree()
    SINGLE.align([parameter])
    SINGLE.average_gradients([parameter])
    assert parameter.grad is gradient
    assert SINGLE.states(state) is state
    assert SINGLE.own_state(state) is state
    assert SINGLE.seed(12) == 12


@pytest.mark.slow
def test_torchrun_trains_and_one_of_two_speaks(tmp_path: Path, pack_file: Path) -> None:
    line = [
        sys.executable, "-m", "torch.distributed.run", "--nproc-per-node", "2", "-m", "kpred", "train", "deformation",
        str(pack_file), "-o", str(tmp_path / "run"), "--device", "cpu", "--json", "--deformation.steps", "2",
        "--deformation.batch", "2", "--points", "96", "--keypoint-points", "64", "--model.width", "16",
    ]  # fmt: skip
    done = subprocess.run(line, capture_output=True, text=True, timeout=240, env={**os.environ, "OMP_NUM_THREADS": "1"})
    assert done.returncode == 0, done.stderr
    facts = json.loads(done.stdout)
    assert facts["processes"] == 2
    record = json.loads((tmp_path / "run" / "model" / "training.json").read_text())
    assert record["processes"] == 2
    checkpoint = Checkpoint.load(tmp_path / "run" / "deformation.checkpoint")
    assert (checkpoint.step, len(checkpoint.random_state)) == (2, 2)
