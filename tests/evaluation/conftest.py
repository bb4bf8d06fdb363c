"""Small packs and untrained networks, so that what is measured can be worked out again by other means."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from kpred.nn import Model
from kpred.shapes.pack import MeshPack
from kpred.synthetic.generator import generate


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
def model(untrained: Model) -> Model:
    return untrained


@pytest.fixture(scope="session")
def model_folder(model: Model, tmp_path_factory: pytest.TempPathFactory) -> Path:
    from kpred.nn import save_network

    folder = tmp_path_factory.mktemp("model")
    for category, network in model.items():
        save_network(network, folder / category)
    return folder


@pytest.fixture(scope="session")
def layout(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A Scan2CAD repository with one scene: a turned, stretched chair on a floor, a trash bin, a chair without CAD."""
    to_z_up, scan, place_of_good = (
        Rotation.from_euler("x", 90, degrees=True),
        "scene0001_00",
        np.array([2.0, -1.0, 0.5]),
    )
    root = tmp_path_factory.mktemp("scan2cad")
    mesh = generate("chair", 4, seed=8)[3]
    low, high = mesh.bounds.astype(np.float64)
    # ShapeNet's frame: front -z, box diagonal 1.
    own = (mesh.vertices - (low + high) / 2) / np.linalg.norm(high - low) * [-1, 1, -1]
    for name in ("good", "gone"):
        folder = root / "Assets" / "shapenet-sample" / "03001627" / name / "models"
        folder.mkdir(parents=True)
        if name == "good":
            trimesh.Trimesh(own, mesh.faces, process=False).export(folder / "model_normalized.obj")
    turn = Rotation.from_euler("z", 40.0, degrees=True) * to_z_up
    scale = np.array([1.1, 1.2, 1.0])
    points = trimesh.sample.sample_surface(trimesh.Trimesh(own * scale, mesh.faces, process=False), 1500, seed=0)[0]
    placed = turn.apply(points) + place_of_good
    ground = placed[:, 2].min()
    floor = np.column_stack([np.random.default_rng(0).uniform(-2, 5, (3000, 2)), np.full(3000, ground - 0.002)])
    cloud = np.concatenate([placed, placed + [2, 0, 0], floor])
    folder = root / "Assets" / "scannet-sample" / scan
    folder.mkdir(parents=True)
    trimesh.PointCloud(cloud).export(folder / f"{scan}_vh_clean_2.ply")
    box = {"bbox": (np.ptp(own, axis=0) / 2).tolist(), "center": [0.0, 0.0, 0.0]}

    def entry(place: np.ndarray, catid: str, id_cad: str) -> dict[str, Any]:
        wxyz = turn.as_quat()[[3, 0, 1, 2]].tolist()
        trs = {"translation": place.tolist(), "rotation": wxyz, "scale": scale.tolist()}
        return {"trs": trs, "catid_cad": catid, "id_cad": id_cad, "sym": "__SYM_ROTATE_UP_2", **box}

    identity = {"translation": [0, 0, 0], "rotation": [1, 0, 0, 0], "scale": [1, 1, 1]}
    models = [
        entry(place_of_good, "03001627", "good"),
        entry(place_of_good + [9, 9, 9], "02747177", "bin"),
        entry(place_of_good + [2, 0, 0], "03001627", "gone"),
    ]
    scene = {"id_scan": scan, "trs": identity, "aligned_models": models}
    (root / "full_annotations.json").write_text(json.dumps([scene]))
    return root
