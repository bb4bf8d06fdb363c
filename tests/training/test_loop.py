"""The training loop: exact resume, determinism, falling losses, interrupts, refusals."""

import os
import signal
from pathlib import Path

import pytest
import torch

from kpred.errors import CheckpointError
from kpred.nn import load_network
from kpred.training.checkpoint import Checkpoint
from kpred.training.config import StageConfig
from kpred.training.loop import learning_rate, train_stage
from kpred.training.losses import DeformationStage
from kpred.training.run import new_network


class Stopped(Exception):
    pass


def _train(folder: Path, data, model, config, stage: str = "deformation", **options):
    network = new_network(model, config.seed)
    train_stage(network, data, config, stage, folder, log=False, **options)
    return network.state_dict()


def _equal(a: dict[str, torch.Tensor], b: dict[str, torch.Tensor]) -> bool:
    return a.keys() == b.keys() and all(torch.equal(a[key], b[key]) for key in a)


def _stop_at(step: int, how=None):
    def report(_stage: str, done: int, _total: int, _losses: dict[str, float]) -> None:
        if done == step:
            if how:
                how()
            raise Stopped

    return report


@pytest.mark.parametrize("stage", ["deformation", "retrieval", "partial"])
def test_resumed_equals_uninterrupted(tmp_path: Path, data, model_config, train_config, stage: str) -> None:
    whole = _train(tmp_path / "whole", data, model_config, train_config, stage)
    with pytest.raises(Stopped):
        _train(tmp_path / "cut", data, model_config, train_config, stage, report=_stop_at(3))
    assert Checkpoint.load(tmp_path / "cut" / f"{stage}.checkpoint").step == 2
    steps: list[int] = []
    resumed = _train(
        tmp_path / "cut", data, model_config, train_config, stage, report=lambda _s, done, _t, _l: steps.append(done)
    )
    assert steps == [3, 4, 5], "the run did not go on where it was"
    assert _equal(whole, resumed)
    ends = [Checkpoint.load(tmp_path / name / f"{stage}.checkpoint") for name in ("whole", "cut")]
    assert torch.equal(ends[0].random_state, ends[1].random_state)
    assert not _equal(whole, new_network(model_config, 0).state_dict())


def test_a_run_is_decided_by_its_seed(tmp_path: Path, data, model_config, train_config, change) -> None:
    torch.manual_seed(1)
    first = _train(tmp_path / "a", data, model_config, train_config)
    torch.manual_seed(2)  # global random state must not matter
    assert _equal(first, _train(tmp_path / "b", data, model_config, train_config))
    assert not _equal(first, _train(tmp_path / "c", data, model_config, change(train_config, seed=1)))


def test_sigint_leaves_a_checkpoint_of_the_last_step(tmp_path: Path, data, model_config, train_config) -> None:
    with pytest.raises(KeyboardInterrupt):
        _train(
            tmp_path / "cut", data, model_config, train_config,
            report=_stop_at(3, lambda: os.kill(os.getpid(), signal.SIGINT)),
        )  # fmt: skip
    assert Checkpoint.load(tmp_path / "cut" / "deformation.checkpoint").step == 3
    resumed = _train(tmp_path / "cut", data, model_config, train_config)
    assert _equal(resumed, _train(tmp_path / "whole", data, model_config, train_config))


@pytest.mark.parametrize("where", ["losses", "update"])
def test_an_interrupt_within_a_step_loses_at_most_that_step(
    tmp_path: Path, data, model_config, train_config, monkeypatch, where: str
) -> None:
    whole = _train(tmp_path / "whole", data, model_config, train_config)
    calls = 0

    def interrupt(original):
        def wrapped(*args, **kwargs):
            nonlocal calls
            calls += 1
            result = original(*args, **kwargs)  # random numbers are drawn, or weights moved, but the step is not done
            if calls == 4:
                raise KeyboardInterrupt
            return result

        return wrapped

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        if where == "losses":
            patch.setattr(DeformationStage, "losses", interrupt(DeformationStage.losses))
        else:
            patch.setattr(torch.optim.Adam, "step", interrupt(torch.optim.Adam.step))
        _train(tmp_path / "cut", data, model_config, train_config)
    assert Checkpoint.load(tmp_path / "cut" / "deformation.checkpoint").step == (3 if where == "losses" else 2)
    assert _equal(_train(tmp_path / "cut", data, model_config, train_config), whole)


def test_other_settings_are_refused(tmp_path: Path, data, model_config, train_config, change) -> None:
    _train(tmp_path, data, model_config, train_config)
    for model, config in (
        (change(model_config, density=100.0), train_config),
        (model_config, change(train_config, seed=4)),
        (model_config, change(train_config, deformation=change(train_config.deformation, steps=9))),
    ):
        with pytest.raises(CheckpointError, match="other settings"):
            _train(tmp_path, data, model, config)
    _train(tmp_path, data, model_config, change(train_config, seed=4), resume=False)
    assert Checkpoint.load(tmp_path / "deformation.checkpoint").train_config["seed"] == 4


def test_a_truncated_checkpoint_is_refused_not_overwritten(tmp_path: Path, data, model_config, train_config) -> None:
    path = tmp_path / "deformation.checkpoint"
    with pytest.raises(Stopped):
        _train(tmp_path, data, model_config, train_config, report=_stop_at(3))
    path.write_bytes(path.read_bytes()[:-500])
    cut = path.read_bytes()
    with pytest.raises(CheckpointError, match="truncated"):
        _train(tmp_path, data, model_config, train_config)
    assert path.read_bytes() == cut


def test_losses_fall(tmp_path: Path, data, model_config, train_config, change) -> None:
    settings = StageConfig(steps=30, batch=4, learning_rate=2e-3)
    config = change(
        train_config, deformation=settings, retrieval=settings, warmup=0, late_step=100, checkpoint_every=100
    )
    for stage, name in (("deformation", "keypoints"), ("retrieval", "reconstruction")):
        losses: list[float] = []
        _train(
            tmp_path, data, model_config, config, stage,
            report=lambda _s, _d, _t, values: losses.append(values[name]),  # noqa: B023
        )  # fmt: skip
        assert len(losses) == 30
        assert sum(losses[-5:]) < 0.6 * sum(losses[:5]), f"{name} does not fall: {losses}"


def test_a_finished_stage_is_left_and_exported(tmp_path: Path, data, model_config, train_config) -> None:
    trained = _train(tmp_path, data, model_config, train_config)
    (tmp_path / "model" / "config.json").unlink()
    again = _train(tmp_path, data, model_config, train_config, report=_stop_at(1))
    assert _equal(trained, again)
    exported = load_network(tmp_path / "model")
    for key, value in exported.state_dict().items():
        torch.testing.assert_close(value, trained[key].half().float(), rtol=0, atol=0)


def test_a_finished_stage_does_not_export_over_later_ones(tmp_path: Path, data, model_config, train_config) -> None:
    _train(tmp_path, data, model_config, train_config)
    later = _train(tmp_path, data, model_config, train_config, "retrieval")
    _train(tmp_path, data, model_config, train_config)
    exported = load_network(tmp_path / "model").state_dict()
    key = "retrieval_encoder.output.weight"
    torch.testing.assert_close(exported[key], later[key].half().float(), rtol=0, atol=0)


def test_a_wild_batch_does_not_poison_the_weights(
    tmp_path: Path, data, model_config, train_config, monkeypatch
) -> None:
    original = DeformationStage.losses

    def wild(self, step: int, generator: torch.Generator):
        losses = original(self, step, generator)
        return {name: value * float("nan") for name, value in losses.items()} if step == 2 else losses

    monkeypatch.setattr(DeformationStage, "losses", wild)
    weights = _train(tmp_path, data, model_config, train_config)
    assert all(torch.isfinite(value).all() for value in weights.values())


def test_learning_rate() -> None:
    cosine = StageConfig(steps=100, learning_rate=0.1)
    rates = [learning_rate(cosine, step) for step in range(101)]
    assert rates[0] == pytest.approx(0.1)
    assert rates[50] == pytest.approx(0.1 * 0.51)
    assert rates[100] == pytest.approx(0.002)
    assert rates == sorted(rates, reverse=True)
    assert learning_rate(StageConfig(schedule="constant", learning_rate=0.3), 77) == 0.3
