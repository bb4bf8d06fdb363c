import json

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from kpred.errors import MeshError, OutputError
from kpred.shapes.formats.polygon import split_polygon, split_quads
from kpred.shapes.mesh import Mesh
from kpred.shapes.mesh_io import OUTPUT_EXTENSIONS, read_geometry, read_mesh, write_mesh


def corners(mesh: Mesh) -> np.ndarray:
    """(F, 9) corner coordinates, as a set of faces: rows sorted, so vertex numbering does not matter."""
    rows = mesh.vertices[mesh.faces].reshape(-1, 9)
    return rows[np.lexsort(rows.T[::-1])]


@pytest.fixture
def sphere() -> Mesh:
    ball = trimesh.creation.icosphere(2, radius=0.7)
    return Mesh(ball.vertices + [0.1, 2.0, -3.0], ball.faces)


@pytest.fixture
def two_boxes() -> Mesh:
    a, b = trimesh.creation.box((1, 2, 3)), trimesh.creation.box((0.5, 0.5, 0.5))
    vertices = np.concatenate([a.vertices, b.vertices + 4])
    return Mesh(vertices, np.concatenate([a.faces, b.faces + 8]), face_parts=np.repeat([3, 8], 12))


@pytest.mark.parametrize("extension", OUTPUT_EXTENSIONS)
def test_what_is_written_comes_back(tmp_path, sphere, extension):
    path = tmp_path / f"ball{extension.upper()}"
    write_mesh(path, sphere)
    back = read_mesh(path)
    assert len(back.vertices) == len(sphere.vertices)
    np.testing.assert_array_equal(corners(back), corners(sphere))
    assert back.face_parts is None
    assert [file.name for file in tmp_path.iterdir()] == [path.name]


@pytest.mark.parametrize("extension", OUTPUT_EXTENSIONS)
def test_trimesh_objects_are_written(tmp_path, extension):
    scene = trimesh.Scene([trimesh.creation.box((1, 1, 1)), trimesh.creation.icosphere(1)])
    write_mesh(tmp_path / f"scene{extension}", scene)
    assert read_mesh(tmp_path / f"scene{extension}").area() == pytest.approx(scene.area, rel=1e-5)
    write_mesh(tmp_path / f"box{extension}", trimesh.creation.box((1, 2, 3)))
    assert read_mesh(tmp_path / f"box{extension}").area() == pytest.approx(22, rel=1e-6)


@pytest.mark.parametrize("extension", [".obj", ".glb"])
def test_parts_come_back(tmp_path, two_boxes, extension):
    write_mesh(tmp_path / f"boxes{extension}", two_boxes)
    back = read_mesh(tmp_path / f"boxes{extension}")
    assert sorted(np.bincount(back.face_parts)) == [12, 12]
    for part in (0, 1):
        piece = Mesh(back.vertices, back.faces[back.face_parts == part])
        assert piece.area() == pytest.approx((22.0, 1.5)[part], rel=1e-6)
    np.testing.assert_array_equal(corners(back), corners(two_boxes))


def test_transforms_of_a_scene_are_applied(tmp_path):
    scene = trimesh.Scene()
    box = trimesh.creation.box((1, 1, 1))
    scene.add_geometry(
        box, node_name="a", geom_name="box", transform=trimesh.transformations.translation_matrix([5, 0, 0])
    )
    mirror = np.diag([-2.0, 1, 1, 1])
    scene.graph.update(frame_to="b", matrix=mirror, geometry="box")
    scene.export(tmp_path / "scene.glb")
    mesh = read_mesh(tmp_path / "scene.glb")
    np.testing.assert_allclose(mesh.bounds, [[-1, -0.5, -0.5], [5.5, 0.5, 0.5]], atol=1e-6)
    assert sorted(np.bincount(mesh.face_parts)) == [12, 12]
    for part in (0, 1):  # A mirrored part keeps its outside outside: its volume stays positive.
        assert trimesh.Trimesh(mesh.vertices, mesh.faces[mesh.face_parts == part], process=False).volume > 0


def test_gltf_with_its_buffer_and_without(tmp_path):
    for name, data in trimesh.Scene(trimesh.creation.box((1, 2, 3))).export(file_type="gltf").items():
        (tmp_path / name).write_bytes(data)
    path = tmp_path / "model.gltf"
    assert read_mesh(path).area() == pytest.approx(22)
    for buffer in json.loads(path.read_text())["buffers"]:
        (tmp_path / buffer["uri"]).unlink()
    with pytest.raises(MeshError, match=r"model\.gltf"):
        read_mesh(path)


OBJ = """mtllib missing.mtl
o seat
v 0 0 0 1 0 0
v 1 0 0 1 0 0
v 1 1 0
v 0 1 0
vt 0 0
vn 0 0 1
usemtl wood
f 1/1/1 2/1/1 3/1/1 4/1/1
o back
\tv 0 0 5
 v 2 0 5
v 2 2 5
v 0 2 5
v 1 1 5
f -5//1 -4//1 \\
  -3//1
f -5 -3 -2
f 1 1 2
g
l 1 2
o empty
"""


def test_obj_of_every_kind_of_line(tmp_path):
    (tmp_path / "chair.obj").write_text(OBJ)
    mesh = read_mesh(tmp_path / "chair.obj")
    assert len(mesh.faces) == 4 and len(mesh.vertices) == 8
    np.testing.assert_array_equal(mesh.face_parts, [0, 0, 1, 1])
    assert Mesh(mesh.vertices, mesh.faces[:2]).area() == pytest.approx(1)
    assert Mesh(mesh.vertices, mesh.faces[2:]).area() == pytest.approx(4)
    (tmp_path / "crlf.obj").write_bytes(OBJ.replace("\n", "\r\n").encode())
    np.testing.assert_array_equal(corners(read_mesh(tmp_path / "crlf.obj")), corners(mesh))


def test_polygons_of_ply_and_off_become_triangles(tmp_path):
    (tmp_path / "a.off").write_text("OFF\n5 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n2 0.5 0\n4 0 1 2 3\n3 1 4 2\n")
    assert read_mesh(tmp_path / "a.off").area() == pytest.approx(1.5)
    head = "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\n"
    head += "element face 2\nproperty list uchar int vertex_indices\nend_header\n"
    (tmp_path / "a.ply").write_text(head + "0 0 0\n1 0 0\n1 1 0\n0 1 0\n2 0.5 0\n4 0 1 2 3\n3 1 4 2\n")
    assert read_mesh(tmp_path / "a.ply").area() == pytest.approx(1.5)


@given(st.integers(4, 24), st.integers(0, 10_000))
def test_polygons_are_cut_into_their_own_area(n, seed):
    """Star-shaped polygons in a random plane: n - 2 triangles, areas that add up (a fan's would overlap)."""
    rng = np.random.default_rng(seed)
    angle = np.linspace(0, 2 * np.pi, n, endpoint=False)
    radius = rng.uniform(0.2, 1.0, n)
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    wanted = 0.5 * (x * np.roll(y, -1) - np.roll(x, -1) * y).sum()
    rotation = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    points = np.stack([x, y, np.zeros(n)], axis=1) @ rotation.T + rng.normal(size=3)
    faces = np.array(split_polygon(points, list(range(n))))
    assert faces.shape == (n - 2, 3)
    a, b, c = (points[faces[:, k]] for k in range(3))
    assert 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() == pytest.approx(wanted, rel=1e-9)
    if n == 4:
        a, b, c = (points[split_quads(points, np.arange(4)[None])[:, k]] for k in range(3))
        assert 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() == pytest.approx(wanted, rel=1e-9)


def test_files_that_hold_no_mesh_are_named(tmp_path):
    def refused(name: str, words: str, content: bytes | None = b"") -> None:
        path = tmp_path / name
        if content is not None:
            path.write_bytes(content)
        with pytest.raises(MeshError, match=words) as caught:
            read_mesh(path)
        assert name in str(caught.value) and "\n" not in str(caught.value)

    refused("none.obj", "no such file", None)
    refused("a.step", "unknown mesh extension", b"x")
    refused("empty.obj", "the file is empty")
    refused("empty.glb", "the file is empty")
    refused("points.obj", "no faces", b"v 0 0 0\nv 1 1 1\n")
    refused("flat.obj", "no face with an area", b"v 0 0 0\nv 1 1 1\nf 1 2 1\n")
    refused("index.obj", "not there", b"v 0 0 0\nv 1 1 1\nf 1 2 3\n")
    refused("zero.obj", "line 2", b"v 0 0 0\nf 0 1 1\n")
    refused("words.obj", "line 1", b"v 0 zero 0\n")
    refused("far.obj", "move it to the origin", b"v 5e5 4e6 0\nv 500001 4e6 0\nv 5e5 4000001 0\nf 1 2 3\n")
    (tmp_path / "folder.obj").mkdir()
    refused("folder.obj", "it is a folder", None)
    for kind in ("ply", "stl", "off", "glb", "gltf"):
        refused(f"noise.{kind}", "not|no faces|damaged", b"\x07\x00noise" * 99)


@pytest.mark.parametrize("extension", [".ply", ".stl", ".glb", ".off"])
def test_cut_files_are_refused(tmp_path, sphere, extension):
    path = tmp_path / f"ball{extension}"
    write_mesh(path, sphere)
    data = path.read_bytes()
    for share in (0.1, 0.5, 0.8):
        path.write_bytes(data[: int(len(data) * share)])
        with pytest.raises(MeshError, match=f"ball{extension}"):
            read_mesh(path)


def test_places_that_cannot_be_written_are_named(tmp_path, sphere, monkeypatch):
    with pytest.raises(OutputError, match=r"a\.xyz: unknown extension"):
        write_mesh(tmp_path / "a.xyz", sphere)
    with pytest.raises(OutputError, match="does not exist"):
        write_mesh(tmp_path / "none" / "a.obj", sphere)
    (tmp_path / "a.ply").write_text("old")

    def full(*_args: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.replace", full)
    with pytest.raises(OutputError, match=r"a\.ply: No space left on device"):
        write_mesh(tmp_path / "a.ply", sphere)
    assert (tmp_path / "a.ply").read_text() == "old" and len(list(tmp_path.iterdir())) == 1


def test_half_a_million_faces(tmp_path):
    rows, columns = np.meshgrid(np.arange(500), np.arange(500), indexing="ij")
    vertices = np.stack([rows, columns, np.sin(rows / 9)], axis=-1).reshape(-1, 3)
    corner = (rows * 500 + columns)[:-1, :-1].ravel()
    faces = np.concatenate(
        [np.stack([corner, corner + 1, corner + 500], 1), np.stack([corner + 1, corner + 501, corner + 500], 1)]
    )
    mesh = Mesh(vertices, faces)
    for extension in (".stl", ".ply"):
        write_mesh(tmp_path / f"a{extension}", mesh)
        back = read_mesh(tmp_path / f"a{extension}")
        assert len(back.faces) == len(faces) and len(back.vertices) == len(vertices)
        assert back.area() == pytest.approx(mesh.area(), rel=1e-6)


def test_shapenet_models(shared_data):
    paths = sorted(shared_data.glob("real/scan2cad*/Assets/shapenet-sample/*/*/models/model_normalized.obj"))
    assert paths
    for path in paths:
        mesh = read_mesh(path)
        blocks = path.read_text().split("\ng ")[1:]
        groups = {block.split("\n")[0] for block in blocks if "\nf " in block}  # Some groups hold lines only.
        assert (1 if mesh.face_parts is None else len(np.unique(mesh.face_parts))) == len(groups)
        # Their normalisation: the box's diagonal has length one.
        assert np.linalg.norm(mesh.bounds[1] - mesh.bounds[0]) == pytest.approx(1, abs=0.02)


UTM = np.array([694386.212, 5155487.512, 381.036])


@pytest.mark.parametrize("extension", [".obj", ".ply", ".off", ".glb"])
def test_far_from_the_origin_a_mesh_keeps_its_shape(tmp_path, extension):
    ball = trimesh.creation.icosphere(2, radius=0.5)
    ball.apply_translation(UTM)
    for mesh in (ball, trimesh.Scene(ball)) if extension != ".glb" else (ball,):
        write_mesh(tmp_path / f"ball{extension}", mesh)
        back = read_geometry(tmp_path / f"ball{extension}")
        np.testing.assert_allclose(back.vertices[back.faces], ball.vertices[ball.faces], atol=1e-5)


def test_stl_is_refused_where_its_numbers_are_too_coarse(tmp_path):
    ball = trimesh.creation.icosphere(2, radius=0.5)
    write_mesh(tmp_path / "near.stl", ball)
    ball.apply_translation(UTM)
    with pytest.raises(OutputError, match=r"far\.stl: this far from the origin"):
        write_mesh(tmp_path / "far.stl", ball)
    assert not (tmp_path / "far.stl").exists()


@pytest.mark.parametrize("extension", OUTPUT_EXTENSIONS)
def test_meshes_that_are_not_finite_are_never_written(tmp_path, extension):
    ball = trimesh.creation.icosphere(1)
    ball.vertices[3] = np.nan
    for mesh in (ball, Mesh(ball.vertices, ball.faces)):
        with pytest.raises(OutputError, match="NaN or infinite"):
            write_mesh(tmp_path / f"a{extension}", mesh)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("extension", [".obj", ".off", ".ply"])
def test_very_small_meshes_keep_their_digits(tmp_path, extension):
    ball = trimesh.creation.icosphere(2, radius=1e-7)
    write_mesh(tmp_path / f"a{extension}", ball)
    back = read_geometry(tmp_path / f"a{extension}")
    np.testing.assert_allclose(back.vertices[back.faces], ball.vertices[ball.faces], rtol=1e-6, atol=1e-14)
