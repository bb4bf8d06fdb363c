from pathlib import Path

import numpy as np
import pytest
import trimesh

from kpred.errors import MeshError, PackError
from kpred.shapes.folder import read_folder
from kpred.shapes.mesh import Mesh
from kpred.shapes.mesh_io import write_mesh
from kpred.shapes.pack import MeshPack
from kpred.shapes.source import open_shapes


def put_box(path: Path, size: tuple[float, float, float] = (1, 2, 3)) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    box = trimesh.creation.box(size)
    write_mesh(path, Mesh(box.vertices + [0.0, 0.0, 0.25], box.faces))


def listed(folder: Path, category: str | None = None) -> list[tuple[str, str]]:
    return [(item.model_id, item.category) for item in read_folder(folder, category)]


def test_a_flat_folder(tmp_path):
    (tmp_path / "chairs").mkdir()
    for name in ("b.obj", "a.GLB", "note.txt", ".hidden.obj"):
        (tmp_path / "chairs" / name).write_bytes(b"")
    assert listed(tmp_path / "chairs") == [("a", "chair"), ("b", "chair")]
    assert listed(tmp_path / "chairs", "Stool") == [("a", "stool"), ("b", "stool")]


def test_folders_of_categories(tmp_path):
    for name in ("tables/t1.glb", "bookcase/b1.glb", "lamp/deep/l1.stl"):
        put_box(tmp_path / name)
    assert listed(tmp_path) == [("b1", "cabinet"), ("l1", "lamp"), ("t1", "table")]
    assert listed(tmp_path, "table") == [("t1", "table")]
    assert listed(tmp_path, "sofa") == [("b1", "sofa"), ("l1", "sofa"), ("t1", "sofa")]


def test_shapenet_layout(tmp_path):
    root = tmp_path / "ShapeNetCore.v2"
    for synset, model in (("03001627", "aa"), ("04379243", "bb"), ("02933112", "cc"), ("02871439", "dd")):
        put_box(root / synset / model / "models" / "model_normalized.obj")
    assert listed(root) == [("dd", "cabinet"), ("cc", "cabinet"), ("aa", "chair"), ("bb", "table")]
    assert listed(root / "03001627") == [("aa", "chair")]
    assert [item.faces_back for item in read_folder(root, "chair")] == [True]


def test_ids_are_unique(tmp_path):
    for name in ("chair/1.obj", "table/1.obj", "table/1.ply", "table/2.ply", "table_1/obj.obj", "x/table_1_obj.stl"):
        put_box(tmp_path / name)
    ids = [model_id for model_id, _ in listed(tmp_path)]
    assert len(set(ids)) == len(ids) == 6
    assert {"2", "obj", "chair_1_obj", "table_1_ply", "table_1_obj", "table_1_obj_2"} == set(ids)


def test_folders_without_meshes_are_named(tmp_path):
    with pytest.raises(MeshError, match="there are no meshes in it"):
        read_folder(tmp_path)
    with pytest.raises(MeshError, match=r"none: there is no such folder"):
        read_folder(tmp_path / "none")


def test_unreadable_meshes_are_reported_and_left_out(tmp_path):
    put_box(tmp_path / "chair" / "good.ply")
    (tmp_path / "chair" / "bad.ply").write_bytes(b"noise")
    (tmp_path / "chair" / "empty.obj").write_bytes(b"")
    messages: list[str] = []
    shapes = list(open_shapes(tmp_path, report=messages.append))
    assert [(shape.model_id, shape.category, shape.split) for shape in shapes] == [("good", "chair", "source")]
    assert len(messages) == 2 and "bad.ply" in messages[0] and "empty.obj" in messages[1]
    with pytest.warns(UserWarning, match=r"bad\.ply"):
        assert len(list(open_shapes(tmp_path))) == 1
    assert list(open_shapes(tmp_path, split="val")) == []


def test_shapenet_models_are_turned_to_face_the_front(tmp_path):
    put_box(tmp_path / "03001627" / "aa" / "models" / "model_normalized.obj")
    put_box(tmp_path / "03001627" / "bb.obj")
    turned, plain = (shape.mesh for shape in open_shapes(tmp_path))
    np.testing.assert_allclose(plain.bounds, [[-0.5, -1, -1.25], [0.5, 1, 1.75]])
    np.testing.assert_allclose(turned.bounds, [[-0.5, -1, -1.75], [0.5, 1, 1.25]])
    assert trimesh.Trimesh(turned.vertices, turned.faces).volume > 0


def test_packs_and_folders_of_packs(tmp_path):
    box = trimesh.creation.box((1, 1, 1))
    good, flat = Mesh(box.vertices, box.faces), Mesh(box.vertices, np.zeros((1, 3), int))
    MeshPack.from_meshes([good, flat, good], ["a", "b", "c"], ["source", "source", "val"], "chair").save(
        tmp_path / "one.npz"
    )
    MeshPack.from_meshes([good], ["t"], ["source"], "table").save(tmp_path / "two.npz")
    messages: list[str] = []

    def found(path: Path, **choice: str) -> list[tuple[str, str, str]]:
        return [tuple(shape[:3]) for shape in open_shapes(path, report=messages.append, **choice)]

    assert found(tmp_path / "one.npz") == [("a", "chair", "source"), ("c", "chair", "val")]
    assert messages == ["b: it has no face with an area; give a mesh with at least one proper triangle."]
    assert found(tmp_path) == [("a", "chair", "source"), ("c", "chair", "val"), ("t", "table", "source")]
    assert found(tmp_path, category="table") == [("t", "table", "source")]
    assert found(tmp_path / "one.npz", split="val") == [("c", "chair", "val")]


def test_paths_that_hold_no_shapes_are_named(tmp_path):
    with pytest.raises(PackError, match=r"none\.npz: there is no such file"):
        open_shapes(tmp_path / "none.npz")
    (tmp_path / "a.obj").write_text("v 0 0 0")
    with pytest.raises(PackError, match=r"a\.obj: it is no mesh pack"):
        open_shapes(tmp_path / "a.obj")


def test_development_shapenet_folder(shared_data):
    root = next((shared_data / "real").glob("*/Assets/shapenet-sample"))
    shapes = list(open_shapes(root, category="chair"))
    assert len(shapes) == 4
    for shape in shapes:
        # In our frame the back stands behind: the highest tenth of the chair lies at negative z.
        vertices = shape.mesh.vertices
        high = vertices[vertices[:, 1] > vertices[:, 1].max() - 0.1 * np.ptp(vertices[:, 1])]
        assert high[:, 2].mean() < 0
