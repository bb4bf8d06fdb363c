"""What a file holds beside positions comes back as it was; positions are the new ones, normals turn with them."""

import io
import json
import struct
import zipfile

import numpy as np
import pytest

from kpred.errors import MeshError
from kpred.shapes import read_mesh
from kpred.shapes.appearance.appearance import Appearance
from kpred.shapes.appearance.read import read_mesh_appearance
from kpred.shapes.appearance.write import appearance_files
from kpred.shapes.credit import Credit
from kpred.shapes.formats.gltf_accessor import read_accessor
from kpred.shapes.formats.gltf_file import read_gltf_file
from kpred.shapes.upright_mesh import stand_mesh

CREDIT = Credit("chair/a", "chair", {"author": "Ann Lee", "licence": "CC0-1.0", "title": "Chair"}, "deformed")


def write(folder, appearance, source, result, name):
    folder.mkdir(exist_ok=True)
    for file, content in appearance_files(appearance, source, result, name, CREDIT).items():
        (folder / file).write_bytes(content)
    return folder / name


def obj_content(path):
    """Everything of an OBJ but its positions and normals."""
    lines = [line for line in path.read_text().splitlines() if line and not line.startswith(("#", "s "))]
    faces = [[word.split("/")[:2] for word in line.split()[1:]] for line in lines if line.startswith("f ")]
    names = [line for line in lines if line.startswith(("o ", "g ", "usemtl "))]
    uvs = [line for line in lines if line.startswith("vt ")]
    vertices = np.array([line.split()[1:4] for line in lines if line.startswith("v ")], float)
    normals = np.array([line.split()[1:4] for line in lines if line.startswith("vn ")], float)
    at = [int(word.split("/")[2]) for line in lines if line.startswith("f ") for word in line.split()[1:]]
    return names, uvs, faces, vertices, normals[np.array(at) - 1]


def glb_content(path):
    """Nodes, materials, images and attributes of a GLB."""
    file = read_gltf_file(path)
    content = file.content
    nodes = [(node.get("name"), node.get("children"), node.get("matrix")) for node in content["nodes"]]
    primitives = [one for mesh in content["meshes"] for one in mesh["primitives"]]
    attributes = [{k: read_accessor(file, v) for k, v in one["attributes"].items()} for one in primitives]
    indices = [read_accessor(file, one["indices"]) for one in primitives]
    images = [file.view(image["bufferView"])[0] for image in content["images"]]
    names = [mesh["name"] for mesh in content["meshes"]]
    return nodes, names, content["materials"], [one["material"] for one in primitives], images, attributes, indices


def test_an_obj_comes_back_with_names_materials_uvs_and_polygons(tmp_path, textured_obj):
    mesh, appearance = read_mesh_appearance(textured_obj)
    file = write(tmp_path / "out", appearance, mesh.vertices, mesh.vertices, "fit.obj")
    before, after = obj_content(textured_obj), obj_content(file)
    assert before[:3] == after[:3]
    np.testing.assert_allclose(after[3], before[3], atol=1e-6)
    np.testing.assert_allclose(after[4], before[4], atol=1e-5)
    assert {one.name for one in file.parent.iterdir()} == {"fit.obj", "fit.mtl", "fit_oak_board.png"}
    assert (file.parent / "fit_oak_board.png").read_bytes() == (textured_obj.parent / "oak board.png").read_bytes()
    materials = (textured_obj.parent / "chair.mtl").read_text().replace("oak board.png", "fit_oak_board.png")
    assert (file.parent / "fit.mtl").read_text() == materials
    assert "mtllib fit.mtl" in file.read_text()


def test_a_glb_comes_back_with_nodes_materials_textures_and_attributes(tmp_path, textured_glb):
    mesh, appearance = read_mesh_appearance(textured_glb)
    file = write(tmp_path / "out", appearance, mesh.vertices, mesh.vertices, "fit.glb")
    before, after = glb_content(textured_glb), glb_content(file)
    assert before[:5] == after[:5]
    for old, new in zip(before[5], after[5], strict=True):
        assert old.keys() == new.keys()
        np.testing.assert_array_equal(old["TEXCOORD_0"], new["TEXCOORD_0"])
        np.testing.assert_allclose(old["POSITION"], new["POSITION"], atol=1e-6)
        np.testing.assert_allclose(old["NORMAL"], new["NORMAL"], atol=1e-5)
    for old, new in zip(before[6], after[6], strict=True):
        np.testing.assert_array_equal(old, new)
    np.testing.assert_allclose(read_mesh(file).vertices, mesh.vertices, atol=1e-6)


@pytest.mark.parametrize("kind", ["obj", "glb"])
def test_positions_are_the_new_ones_and_normals_turn_with_their_faces(tmp_path, request, kind):
    source_file = request.getfixturevalue(f"textured_{kind}")
    mesh, appearance = read_mesh_appearance(source_file)
    shear = np.array([[1, 0, 0], [0.7, 1.4, 0], [0, 0.2, 0.8]])
    result = mesh.vertices @ shear.T + [5, 6, 7]
    file = write(tmp_path / "out", appearance, mesh.vertices, result, f"fit.{kind}")
    found = read_mesh(file)
    np.testing.assert_allclose(found.vertices, result, atol=1e-5)
    np.testing.assert_array_equal(found.faces, mesh.faces)
    if kind == "obj":
        expected = obj_content(source_file)[4] @ np.linalg.inv(shear)
        expected /= np.linalg.norm(expected, axis=1, keepdims=True)
        np.testing.assert_allclose(obj_content(file)[4], expected, atol=1e-4)
        return
    corners = found.vertices[found.faces].astype(float)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert len(glb_content(file)[5]) == 6
    world = _world_normals(file)
    assert (np.einsum("fi,fi->f", normals, world[found.faces[:, 0]]) > 0).all()
    np.testing.assert_allclose(np.cross(normals, world[found.faces[:, 0]]), 0, atol=1e-5)


def _world_normals(path):
    from kpred.shapes.formats.gltf import walk_nodes

    file, found = read_gltf_file(path), []
    for node, world in walk_nodes(file):
        if "mesh" in node:
            for primitive in file.content["meshes"][node["mesh"]]["primitives"]:
                normals = read_accessor(file, primitive["attributes"]["NORMAL"]) @ np.linalg.inv(world[:3, :3])
                found.append(normals / np.linalg.norm(normals, axis=1, keepdims=True))
    return np.concatenate(found)


@pytest.mark.parametrize(("kind", "other"), [("obj", "glb"), ("glb", "obj")])
def test_the_other_format_has_the_same_surface_materials_and_credit(tmp_path, request, kind, other):
    mesh, appearance = read_mesh_appearance(request.getfixturevalue(f"textured_{kind}"))
    file = write(tmp_path / "out", appearance, mesh.vertices, mesh.vertices, f"fit.{other}")
    found = read_mesh(file)
    np.testing.assert_allclose(found.bounds, mesh.bounds, atol=1e-5)
    assert found.area() == pytest.approx(mesh.area(), rel=1e-4)
    text = file.read_bytes().decode("latin-1")
    assert "Ann Lee" in text
    if other == "glb":
        assert {one["name"] for one in read_gltf_file(file).content["materials"]} == {"oak wood", "fabric"}
        assert len(read_gltf_file(file).content["images"]) == 1
        shine = [one["pbrMetallicRoughness"]["metallicFactor"] for one in read_gltf_file(file).content["materials"]]
        assert shine == [0, 0]
    else:
        assert text.count("usemtl") >= 2
        assert [one.suffix for one in sorted(file.parent.glob("fit_*"))] == [".png"]


def test_axes_and_sizes_of_a_manifest_are_part_of_the_mesh_alone(tmp_path, textured_obj):
    mesh, appearance = read_mesh_appearance(textured_obj, lambda one: stand_mesh(one, "z", "-y", None))
    file = write(tmp_path / "out", appearance, mesh.vertices, mesh.vertices, "fit.obj")
    np.testing.assert_allclose(read_mesh(file).vertices, mesh.vertices, atol=1e-6)
    normals = obj_content(textured_obj)[4] @ appearance.rotation.T
    np.testing.assert_allclose(obj_content(file)[4], normals, atol=1e-5)


def test_far_from_the_origin_nothing_is_lost(tmp_path, textured_glb):
    mesh, appearance = read_mesh_appearance(textured_glb)
    result = mesh.vertices.astype(float) + [4.5e6, 0, 5.2e6]
    file = write(tmp_path / "out", appearance, mesh.vertices, result, "fit.glb")
    content = read_gltf_file(file).content
    (root,) = content["scenes"][0]["nodes"]
    assert content["nodes"][root]["name"] == "scan"
    moved = read_mesh_appearance_vertices(file) - [4.5e6, 0, 5.2e6]
    np.testing.assert_allclose(moved, mesh.vertices, atol=1e-5)


def read_mesh_appearance_vertices(file):
    from kpred.shapes.mesh_io import read_geometry

    return read_geometry(file).vertices


def test_packing_gives_the_same_back_and_the_same_bytes(textured_obj):
    appearance = read_mesh_appearance(textured_obj)[1]
    again = Appearance.unpack(appearance.pack())
    assert again.files == dict(appearance.files)
    assert (again.kind, again.digest()) == ("obj", appearance.digest())
    np.testing.assert_array_equal(again.vertex_map, appearance.vertex_map)
    assert again.pack() == appearance.pack()


def test_vertices_without_a_face_go_with_their_neighbours(tmp_path):
    file = tmp_path / "a.obj"
    file.write_text("o a\nv 9 0 0\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nusemtl x\nf 2 3 4\nf 2 3 5\nf 3 3 4\n")
    mesh, appearance = read_mesh_appearance(file)
    assert len(mesh.vertices) == 4
    out = write(tmp_path / "out", appearance, mesh.vertices, 2 * mesh.vertices, "b.obj")
    np.testing.assert_allclose(obj_vertices(out), [[18, 0, 0], [0, 0, 0], [2, 0, 0], [0, 2, 0], [0, 0, 2]], atol=1e-9)


def obj_vertices(path):
    return np.array([line.split()[1:4] for line in path.read_text().splitlines() if line.startswith("v ")], float)


@pytest.mark.parametrize(
    "text", ["v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "o one\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"]
)
def test_a_bare_surface_has_no_appearance(tmp_path, text):
    (tmp_path / "a.obj").write_text(text)
    assert read_mesh_appearance(tmp_path / "a.obj")[1] is None


def test_missing_materials_and_textures_do_not_cost_the_model(tmp_path, textured_obj, textured_glb):
    (textured_obj.parent / "oak board.png").unlink()
    mesh, appearance = read_mesh_appearance(textured_obj)
    assert set(appearance.files) == {"model.obj", "model.mtl"}
    (textured_obj.parent / "chair.mtl").unlink()
    assert set(read_mesh_appearance(textured_obj)[1].files) == {"model.obj"}
    assert len(mesh.vertices) == 48


def test_files_outside_of_the_folder_are_not_read(tmp_path, textured_obj):
    (tmp_path / "secret.png").write_bytes(b"secret")
    (textured_obj.parent / "linked.png").symlink_to(tmp_path / "secret.png")
    materials = "newmtl fabric\nmap_Kd ../secret.png\nmap_Ks /etc/hostname\nmap_Ka linked.png\n"
    (textured_obj.parent / "chair.mtl").write_text(materials)
    appearance = read_mesh_appearance(textured_obj)[1]
    assert set(appearance.files) == {"model.obj", "model.mtl"}


def test_two_nodes_of_one_mesh_become_two_meshes(tmp_path):
    import trimesh

    scene = trimesh.Scene()
    box = trimesh.creation.box([1, 1, 1])
    for number in range(2):
        place = np.eye(4)
        place[0, 3] = 3 * number
        scene.add_geometry(box, node_name=f"n{number}", geom_name="box", transform=place)
    file = tmp_path / "a.glb"
    file.write_bytes(scene.export(file_type="glb"))
    mesh, appearance = read_mesh_appearance(file)
    result = mesh.vertices * np.where(mesh.vertices[:, :1] > 1.5, 2.0, 1.0)
    out = write(tmp_path / "out", appearance, mesh.vertices, result, "b.glb")
    np.testing.assert_allclose(read_mesh(out).vertices, result, atol=1e-6)
    assert {node["name"] for node in read_gltf_file(out).content["nodes"]} >= {"n0", "n1"}


def test_credit_is_in_the_asset(tmp_path, textured_glb):
    mesh, appearance = read_mesh_appearance(textured_glb)
    file = write(tmp_path / "out", appearance, mesh.vertices, mesh.vertices, "fit.glb")
    asset = read_gltf_file(file).content["asset"]
    assert asset["copyright"] == "Ann Lee, CC0-1.0"
    assert asset["extras"]["model_id"] == "chair/a"
    json.dumps(asset)


def test_a_mesh_compressed_by_draco_comes_out_plain_with_its_uvs(tmp_path, textured_glb):
    import trimesh

    packed = tmp_path / "packed.glb"
    scene = trimesh.load_scene(textured_glb, process=False)
    packed.write_bytes(scene.export(file_type="glb", extension_draco=True))
    assert "KHR_draco_mesh_compression" in read_gltf_file(packed).content["extensionsRequired"]
    mesh, appearance = read_mesh_appearance(packed)
    file = write(tmp_path / "out", appearance, mesh.vertices, mesh.vertices, "fit.glb")
    content = read_gltf_file(file).content
    assert "KHR_draco_mesh_compression" not in json.dumps(content)
    np.testing.assert_allclose(read_mesh(file).vertices, mesh.vertices, atol=1e-6)
    found = glb_content(file)
    assert sum("TEXCOORD_0" in one for one in found[5]) == 6
    assert {one["name"] for one in found[2]} == {"oak wood", "fabric"}


@pytest.mark.parametrize("name", ["obj/../evil.png", "obj//etc/evil.png", "obj/.hidden", "obj/a\\b.png"])
def test_files_of_a_foreign_database_lie_in_no_folder(textured_obj, name):
    appearance = read_mesh_appearance(textured_obj)[1]
    stream = io.BytesIO(appearance.pack())
    assert set(Appearance.unpack(stream.getvalue()).files) == set(appearance.files)
    with zipfile.ZipFile(stream, "a") as archive:
        archive.writestr(name, b"evil")
    with pytest.raises(ValueError, match="a file in a folder"):
        Appearance.unpack(stream.getvalue())


def _changed(path, change):
    """The GLB with its JSON changed."""
    data = path.read_bytes()
    size = struct.unpack("<I", data[12:16])[0]
    content = json.loads(data[20 : 20 + size])
    change(content)
    text = json.dumps(content).encode()
    text += b" " * (-len(text) % 4)
    rest = data[20 + size :]
    path.write_bytes(b"glTF" + struct.pack("<III", 2, 20 + len(text) + len(rest), len(text)) + b"JSON" + text + rest)
    return path


def _mirror(content):
    for node in content["nodes"]:
        if node.get("name") == "back":
            node["matrix"] = (np.array(node["matrix"]).reshape(4, 4) * [[-1], [1], [1], [1]]).ravel().tolist()


def _animate(content):
    """A skin, and a morph target that makes the seat half as large again."""
    node = next(node for node in content["nodes"] if node.get("name") == "seat")
    mesh = content["meshes"][node["mesh"]]
    mesh["weights"], node["skin"], content["skins"] = [0.5], 0, [{"joints": [0]}]
    attributes = mesh["primitives"][0]["attributes"]
    mesh["primitives"][0]["targets"] = [{"POSITION": attributes["POSITION"]}]
    attributes |= {"JOINTS_0": attributes["POSITION"], "WEIGHTS_0": attributes["POSITION"]}


@pytest.mark.parametrize("change", [_mirror, _animate], ids=["negative scale", "skin and morph target"])
def test_mirrored_nodes_and_animated_meshes_keep_surface_names_and_uvs(tmp_path, textured_glb, change):
    before = glb_content(textured_glb)
    mesh, appearance = read_mesh_appearance(_changed(textured_glb, change))
    out = write(tmp_path / "out", appearance, mesh.vertices, mesh.vertices * np.float32(1.1), "b.glb")
    written = read_mesh(out)
    np.testing.assert_allclose(written.vertices, mesh.vertices * np.float32(1.1), atol=1e-6)
    # The same side is outside: a mirrored box has a positive volume too.
    corners = written.vertices[written.faces].astype(float)
    assert np.einsum("fi,fi->f", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() > 0
    after = glb_content(out)
    assert after[1] == before[1] and after[2] == before[2]
    for old, new in zip(before[5], after[5], strict=True):
        np.testing.assert_array_equal(new["TEXCOORD_0"], old["TEXCOORD_0"])
        assert set(new) == {"POSITION", "NORMAL", "TEXCOORD_0"}
    assert not any("skin" in node for node in read_gltf_file(out).content["nodes"])


def test_nodes_in_a_circle_are_one_sentence(textured_glb):
    def change(content):
        child = next(number for number, node in enumerate(content["nodes"]) if node.get("name") == "seat")
        content["nodes"][child]["children"] = [content["scenes"][0]["nodes"][0]]

    with pytest.raises(MeshError, match="node") as failure:
        read_mesh_appearance(_changed(textured_glb, change))
    assert "\n" not in str(failure.value)


def test_textures_that_are_too_large_are_left_out_with_a_warning(tmp_path):
    from kpred.shapes.appearance.companions import find_companion

    (tmp_path / "big.png").write_bytes(bytes(2000))
    assert find_companion(tmp_path / "a.obj", ["big.png"], 2000) == ("big.png", bytes(2000))
    with pytest.warns(UserWarning, match=r"a\.obj: its big\.png of 0 MB is too large and left out"):
        assert find_companion(tmp_path / "a.obj", ["big.png"], 1999) is None
