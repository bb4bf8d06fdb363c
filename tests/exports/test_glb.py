"""GLB of results: metres, y up, below a node that is the scan's frame; materials, names and facts are there."""

from pathlib import Path

import numpy as np
import trimesh

from kpred.exports.formats import save_export
from kpred.exports.furniture import Export
from kpred.shapes import read_mesh
from kpred.shapes.formats.gltf_file import read_gltf_file


def to_y_up(points: np.ndarray) -> np.ndarray:
    return points[:, [0, 2, 1]] * [1, 1, -1] / 1000


def test_a_scan_in_millimetres_with_z_up_stands_upright_in_metres(chair: Export, tmp_path: Path) -> None:
    (file,) = save_export(chair, tmp_path / "chair.glb")
    wanted = to_y_up(chair.objects[0].vertices)
    found = read_mesh(file)
    np.testing.assert_allclose(found.bounds, [wanted.min(axis=0), wanted.max(axis=0)], atol=1e-5)
    seen = trimesh.load_scene(file).bounds
    np.testing.assert_allclose(seen, [wanted.min(axis=0), wanted.max(axis=0)], atol=1e-5)
    assert 1.0 < np.ptp(seen[:, 1]) < 1.2


def test_the_node_of_the_scan_leads_back_to_the_scan(chair: Export, tmp_path: Path) -> None:
    (file,) = save_export(chair, tmp_path / "chair.glb")
    content = read_gltf_file(file).content
    ((root,),) = (content["scenes"][0]["nodes"],)
    assert content["nodes"][root]["name"] == "scan"
    matrix = np.reshape(content["nodes"][root]["matrix"], (4, 4)).T
    back = np.linalg.inv(matrix)
    found = read_mesh(file).vertices @ back[:3, :3].T + back[:3, 3]
    wanted = chair.objects[0].vertices
    np.testing.assert_allclose(found.min(axis=0), wanted.min(axis=0), atol=0.01)
    np.testing.assert_allclose(found.max(axis=0), wanted.max(axis=0), atol=0.01)


def test_model_category_confidence_licence_and_author_are_in_the_file(chair: Export, tmp_path: Path) -> None:
    (file,) = save_export(chair, tmp_path / "chair.glb")
    content = read_gltf_file(file).content
    wanted = {"model_id": "shop/chair 7", "category": "chair", "confidence": 0.75, "author": "Ann"}
    wanted["licence"] = "CC0-1.0"
    (node,) = (node for node in content["nodes"] if node.get("name") == "chair 0")
    assert wanted.items() <= node["extras"].items()
    assert wanted.items() <= content["asset"]["extras"].items()
    assert content["asset"]["copyright"] == "Ann, CC0-1.0"


def test_a_room_keeps_the_materials_and_nodes_of_each_object(room: Export, tmp_path: Path) -> None:
    (file,) = save_export(room, tmp_path / "room.glb")
    content = read_gltf_file(file).content
    names = [node.get("name") for node in content["nodes"]]
    assert names.count("seat") == 2 and {"chair 0", "chair 1", "scan"} <= set(names)
    scene = trimesh.load_scene(file)
    wanted = to_y_up(np.concatenate([one.vertices for one in room.objects]))
    np.testing.assert_allclose(scene.bounds, [wanted.min(axis=0), wanted.max(axis=0)], atol=1e-5)
    colors = {
        name: mesh.visual.material.baseColorTexture is not None
        for name, mesh in scene.geometry.items()
        if name.startswith(("leg", "seat"))
    }
    assert len(colors) >= 5
    assert all(has_texture == name.startswith("leg") for name, has_texture in colors.items())
