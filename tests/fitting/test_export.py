"""A textured model through database and fit: names, materials, UVs and the number of vertices are those of its file."""

import json

import numpy as np
import pytest

import kpred
from kpred.database import Database, build_database
from kpred.fitting.export import save_result
from kpred.nn import load_model
from kpred.shapes import open_shapes, read_mesh
from kpred.shapes.formats.gltf_accessor import read_accessor
from kpred.shapes.formats.gltf_file import read_gltf_file

BOXES = {
    "seat": ([0.5, 0.05, 0.5], [0, 0.45, 0], "fabric"),
    "back": ([0.5, 0.5, 0.05], [0, 0.7, -0.225], "fabric"),
    **{f"leg {x} {z}": ([0.05, 0.45, 0.05], [0.2 * x, 0.2, 0.2 * z], "oak") for x in (-1, 1) for z in (-1, 1)},
}
QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]


def corners(size, middle):
    bits = np.array([[c >> 2 & 1, c >> 1 & 1, c & 1] for c in range(8)]) - 0.5
    return np.array(middle) + bits * size


def write_obj(folder):
    lines = ["mtllib a.mtl", "vt 0 0", "vt 1 0", "vt 1 1", "vt 0 1"]
    for number, (name, (size, middle, material)) in enumerate(BOXES.items()):
        lines += [f"o {name}", f"usemtl {material}"]
        lines += ["v {:.6g} {:.6g} {:.6g}".format(*corner) for corner in corners(size, middle)]
        lines += ["f " + " ".join(f"{8 * number + v + 1}/{t + 1}" for t, v in enumerate(quad)) for quad in QUADS]
    (folder / "a.mtl").write_text("newmtl oak\nmap_Kd oak.png\nnewmtl fabric\nKd 0 0 1\n")
    (folder / "oak.png").write_bytes(b"\x89PNG pixels")
    (folder / "a.obj").write_text("\n".join(lines) + "\n")


def write_glb(folder):
    import trimesh
    from PIL import Image

    oak = trimesh.visual.material.PBRMaterial(name="oak", baseColorTexture=Image.new("RGB", (2, 2), (9, 8, 7)))
    fabric = trimesh.visual.material.PBRMaterial(name="fabric", baseColorFactor=[0, 0, 255, 255])
    scene = trimesh.Scene()
    for name, (size, middle, material) in BOXES.items():
        mesh = trimesh.Trimesh(corners(size, [0, 0, 0]), [t for a, b, c, d in QUADS for t in ((a, b, c), (a, c, d))])
        uv = np.random.default_rng(0).random((8, 2))
        mesh.visual = trimesh.visual.TextureVisuals(uv=uv, material=oak if material == "oak" else fabric)
        place = np.eye(4)
        place[:3, 3] = middle
        scene.add_geometry(mesh, node_name=name, geom_name=name, transform=place)
    (folder / "a.glb").write_bytes(scene.export(file_type="glb"))


@pytest.fixture(scope="module")
def fitted(tmp_path_factory):
    """Fits of a stretched and turned scan by a database that holds the chair as OBJ, as GLB, and bare."""
    folder = tmp_path_factory.mktemp("chairs")
    meshes = folder / "catalogue"
    meshes.mkdir()
    write_obj(meshes)
    write_glb(meshes)
    (meshes / "bare.ply").write_bytes(_ply(meshes / "a.obj"))
    rows = ["id,path,category,author,licence", "chair/obj,a.obj,chair,Ann,CC0-1.0", "chair/glb,a.glb,chair,Bo,"]
    (meshes / "manifest.csv").write_text("\n".join([*rows, "chair/bare,bare.ply,chair,,"]))
    path = folder / "a.kpred"
    model = load_model()
    build_database(path, open_shapes(meshes, appearance=True), model)
    surface = read_mesh(meshes / "a.obj")
    import trimesh

    points, _ = trimesh.sample.sample_surface(trimesh.Trimesh(surface.vertices, surface.faces), 3000, seed=0)
    turn = np.array([[0.8, 0, 0.6], [0, 1, 0], [-0.6, 0, 0.8]])
    scan = points * [1.25, 1.1, 0.9] @ turn.T + [3, 0.5, -2]
    with Database.open(path) as database:
        names = ("obj", "glb", "bare")
        yield {
            name: kpred.fit(scan, model, database, "chair", up="y", deform="structure", model_id=f"chair/{name}")
            for name in names
        }


def _ply(file):
    import trimesh

    mesh = read_mesh(file)
    return trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).export(file_type="ply")


def test_an_obj_keeps_names_materials_uvs_and_vertices(tmp_path, fitted):
    fit = fitted["obj"]
    assert {one.name for one in fit.save(tmp_path / "b.obj")} == {"b.obj", "b.mtl", "b_oak.png"}
    lines = (tmp_path / "b.obj").read_text().splitlines()
    (tmp_path / "source").mkdir()
    write_obj(tmp_path / "source")
    wanted = (tmp_path / "source" / "a.obj").read_text().splitlines()
    rest = [[line for line in one if not line.startswith(("v ", "#", "mtllib"))] for one in (lines, wanted)]
    assert rest[0] == rest[1]
    assert sum(line.startswith("v ") for line in lines) == 48
    assert "map_Kd b_oak.png" in (tmp_path / "b.mtl").read_text()
    np.testing.assert_allclose(read_mesh(tmp_path / "b.obj").vertices, fit.mesh.vertices, atol=1e-6)


def test_a_glb_keeps_names_materials_uvs_and_vertices(tmp_path, fitted):
    fit = fitted["glb"]
    fit.save(tmp_path / "b.glb")
    (tmp_path / "source").mkdir()
    write_glb(tmp_path / "source")
    found, wanted = (read_gltf_file(file) for file in (tmp_path / "b.glb", tmp_path / "source" / "a.glb"))
    for key in ("materials", "textures"):
        assert found.content[key] == wanted.content[key]
    names = [node.get("name") for node in found.content["nodes"]]
    assert names == [*(node.get("name") for node in wanted.content["nodes"]), "chair/glb", "scan"]
    for left, right in zip(found.content["meshes"], wanted.content["meshes"], strict=True):
        (one,), (other,) = left["primitives"], right["primitives"]
        assert (left["name"], one["material"]) == (right["name"], other["material"])
        uvs = [read_accessor(f, p["attributes"]["TEXCOORD_0"]) for f, p in ((found, one), (wanted, other))]
        np.testing.assert_array_equal(*uvs)
        positions = [read_accessor(f, p["attributes"]["POSITION"]) for f, p in ((found, one), (wanted, other))]
        assert positions[0].shape == positions[1].shape
    np.testing.assert_allclose(read_mesh(tmp_path / "b.glb").vertices, fit.mesh.vertices, atol=1e-5)


@pytest.mark.parametrize("name", ["obj", "glb", "bare"])
@pytest.mark.parametrize("extension", [".obj", ".glb", ".ply", ".stl", ".off"])
def test_every_format_holds_the_same_surface_and_names_the_author(tmp_path, fitted, name, extension):
    file = tmp_path / f"b{extension}"
    save_result(fitted[name], file)
    found = read_mesh(file)
    np.testing.assert_allclose(found.bounds, fitted[name].mesh.bounds, atol=1e-5)
    assert found.area() == pytest.approx(fitted[name].mesh.area, rel=1e-4)
    if extension != ".stl":
        text = file.read_bytes().decode("latin-1")
        assert f"chair/{name}" in text
        assert {"obj": "Ann", "glb": "Bo", "bare": "placed and deformed by kpred"}[name] in text


def test_the_record_names_author_licence_and_id(fitted):
    record = json.loads(json.dumps(fitted["obj"].to_json()))
    assert record["model_id"] == "chair/obj"
    assert record["catalogue"]["author"] == "Ann"
    assert record["catalogue"]["licence"] == "CC0-1.0"
