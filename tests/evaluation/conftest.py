"""Small packs and untrained networks, so that what is measured can be worked out again by other means."""

from pathlib import Path

import pytest

from kpred.nn import Model, ModelConfig
from kpred.shapes.pack import MeshPack
from kpred.shapes.synthetic.generator import generate
from kpred.training.run import new_network


def make_pack(category: str, path: Path, seed: int = 0) -> Path:
    """12 shapes: 9 source and 3 val."""
    pack = generate(category, 12, seed, splits=False)
    splits = ["val" if i % 4 == 3 else "source" for i in range(12)]
    path.parent.mkdir(exist_ok=True)
    MeshPack.from_meshes(list(pack), list(pack.model_id), splits, category).save(path)
    return path


@pytest.fixture(scope="session")
def packs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("packs") / "generated"
    return {category: make_pack(category, folder / f"{category}.npz") for category in ("chair", "table")}


@pytest.fixture(scope="session")
def model() -> Model:
    networks = {}
    for category in ("chair", "table"):
        config = ModelConfig(category=category, width=16, token_size=8, region_points=16, stages=1)
        networks[category] = new_network(config, seed=0).eval().requires_grad_(False)
    return Model("untrained", networks)


@pytest.fixture(scope="session")
def model_folder(model: Model, tmp_path_factory: pytest.TempPathFactory) -> Path:
    from kpred.nn import save_network

    folder = tmp_path_factory.mktemp("model")
    for category, network in model.items():
        save_network(network, folder / category)
    return folder
