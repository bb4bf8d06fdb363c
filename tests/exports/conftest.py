"""A small chair as exports take it: bare, with materials of an OBJ, and with materials and nodes of a GLB."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from kpred.exports.furniture import Export, Furniture
from kpred.ops.rotations import upright_rotation, yaw_rotation
from kpred.shapes.appearance.read import read_mesh_appearance
from kpred.shapes.credit import Credit

BOXES = {
    "seat": ([0.5, 0.05, 0.5], [0, 0.45, 0], "fabric"),
    "back": ([0.5, 0.5, 0.05], [0, 0.725, -0.225], "fabric"),
    **{f"leg {x} {z}": ([0.05, 0.425, 0.05], [0.2 * x, 0.2125, 0.2 * z], "oak") for x in (-1, 1) for z in (-1, 1)},
}
QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
TRIANGLES = [corner for a, b, c, d in QUADS for corner in ((a, b, c), (a, c, d))]
YAW = 0.7


def corners(size: list[float], middle: list[float]) -> np.ndarray:
    bits = np.array([[c >> 2 & 1, c >> 1 & 1, c & 1] for c in range(8)]) - 0.5
    return np.array(middle) + bits * size


def write_glb(file: Path) -> None:
    oak = trimesh.visual.material.PBRMaterial(name="oak", baseColorTexture=Image.new("RGB", (2, 2), (9, 8, 7)))
    fabric = trimesh.visual.material.PBRMaterial(name="fabric", baseColorFactor=[0, 0, 255, 255])
    scene = trimesh.Scene()
    for name, (size, middle, material) in BOXES.items():
        mesh = trimesh.Trimesh(corners(size, [0, 0, 0]), TRIANGLES, process=False)
        uv = np.random.default_rng(0).random((8, 2))
        mesh.visual = trimesh.visual.TextureVisuals(uv=uv, material=oak if material == "oak" else fabric)
        place = np.eye(4)
        place[:3, 3] = middle
        scene.add_geometry(mesh, node_name=name, geom_name=name, transform=place)
    file.write_bytes(scene.export(file_type="glb"))


def place_furniture(file: Path, name: str, to_scan: np.ndarray, rotation: np.ndarray) -> Furniture:
    """A model's file, stretched by a tenth in height and placed in a scan."""
    mesh, appearance = read_mesh_appearance(file)
    source = mesh.vertices.astype(np.float64)
    grown = source * [1, 1.1, 1]
    parts = np.repeat(np.arange(len(BOXES)), 8)
    details = {"author": "Ann", "licence": "CC0-1.0", "title": "A chair"}
    credit = Credit("shop/chair 7", "chair", details, "placed", {"confidence": 0.75})
    vertices = grown @ to_scan[:3, :3].T + to_scan[:3, 3]
    axes = np.tile(np.eye(3), (len(BOXES), 1, 1))
    return Furniture(name, vertices, mesh.faces, parts, source, rotation, axes, credit, appearance)


def place_chairs(folder: Path, kind: str, places: list[list[float]]) -> Export:
    """Chairs in a scan in millimetres, z up, far from its origin; `kind`: bare or glb."""
    file = folder / "model.glb"
    write_glb(file)
    if kind == "bare":
        trimesh.load(file, force="mesh", process=False).export(folder / "model.ply")
        file = folder / "model.ply"
    upright = upright_rotation("z")
    rotation = yaw_rotation(-YAW) @ upright
    chairs = []
    for number, place in enumerate(places):
        to_scan = np.eye(4)
        to_scan[:3, :3], to_scan[:3, 3] = 1000 * rotation.T, place
        chairs.append(place_furniture(file, f"chair {number}", to_scan, rotation))
    return Export(tuple(chairs), upright, 0.001)


@pytest.fixture(params=["bare", "glb"])
def chair(tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest) -> Export:
    """One chair whose feet are at (2, 3, 0.5) m."""
    return place_chairs(tmp_path_factory.mktemp("model"), request.param, [[2000, 3000, 500]])


@pytest.fixture
def room(tmp_path_factory: pytest.TempPathFactory) -> Export:
    """Two chairs with materials, two metres apart."""
    return place_chairs(tmp_path_factory.mktemp("model"), "glb", [[2000, 3000, 500], [4000, 3000, 500]])
