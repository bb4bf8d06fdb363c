"""A pack and settings so small that a whole training takes a second."""

import dataclasses
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import torch

from kpred.errors import CheckpointError
from kpred.nn import KPRed, ModelConfig
from kpred.shapes.pack import MeshPack
from kpred.synthetic.generator import generate
from kpred.training.config import StageConfig, TrainConfig
from kpred.training.data import TrainingData, prepare
from kpred.training.run import new_network

MODEL = ModelConfig(category="table", width=16, token_size=8, region_points=16)
STAGE = StageConfig(steps=5, batch=2)
TRAIN = TrainConfig(
    deformation=STAGE, retrieval=STAGE, partial=STAGE, points=96, keypoint_points=64, warmup=1, late_step=3,
    checkpoint_every=2,
)  # fmt: skip


@pytest.fixture(autouse=True, scope="module")
def one_thread() -> Iterator[None]:
    """Sums of floats depend on the number of threads; bit for bit needs one number, for what modules share too."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


@pytest.fixture(scope="session")
def pack() -> MeshPack:
    return generate("table", 4, seed=3, splits=False)


@pytest.fixture(scope="session")
def pack_file(pack: MeshPack, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("pack") / "table.npz"
    pack.save(path)
    return path


@pytest.fixture(scope="session")
def data(pack: MeshPack) -> TrainingData:
    return prepare([pack], new_network(MODEL, 0), TRAIN.points, seed=0)


@pytest.fixture(scope="session")
def model_config() -> ModelConfig:
    return MODEL


@pytest.fixture(scope="session")
def train_config() -> TrainConfig:
    return TRAIN


@pytest.fixture
def network() -> KPRed:
    """Fresh networks whose zero-initialised heads are perturbed, so that gradients reach what lies before them."""
    network = new_network(MODEL, 0)
    generator = torch.Generator().manual_seed(1)
    for parameter in network.parameters():
        parameter.data += 0.02 * torch.randn(parameter.shape, generator=generator)
    return network


@pytest.fixture
def change():
    """A copy of a config with single settings changed."""
    return dataclasses.replace


class Stopped(Exception):
    """Raised by a report in the middle of a training."""


@pytest.fixture
def resume(tmp_path: Path) -> Callable[[Callable[..., torch.nn.Module], Any], None]:
    """Check that a training of five steps, stopped after three and continued, ends as an uninterrupted one."""

    def check(train: Callable[..., torch.nn.Module], config: Any) -> None:
        whole = train(config, tmp_path / "whole")

        def stop(_stage: str, done: int, _total: int, _losses: dict[str, float]) -> None:
            if done == 3:
                raise Stopped

        with pytest.raises(Stopped):
            train(config, tmp_path / "cut", report=stop)
        resumed = train(config, tmp_path / "cut")
        pairs = zip(whole.state_dict().values(), resumed.state_dict().values(), strict=True)
        assert all(torch.equal(a, b) for a, b in pairs)
        with pytest.raises(CheckpointError, match="other settings"):
            train(dataclasses.replace(config, noise=0.5), tmp_path / "cut")

    return check
