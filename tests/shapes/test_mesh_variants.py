"""The same mesh in the many ways that programs write it: every file gives the same triangles."""

import base64
import json
import struct
from pathlib import Path

import numpy as np
import pytest

from kpred.errors import MeshError
from kpred.shapes.formats.polygon import triangulate
from kpred.shapes.mesh_io import read_geometry, read_mesh
from kpred.shapes.scan import read_scan

VERTICES = np.array([[x, y, z] for x in (0.0, 2.0) for y in (0.0, 1.0) for z in (0.0, 0.5)])
QUADS = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4]])
TRIANGLES = np.array([[1, 5, 7], [1, 7, 3]])
AREA, SIZE = 2 * (2 * 1 + 2 * 0.5 + 1 * 0.5), [2.0, 1.0, 0.5]
ALL = np.concatenate([QUADS[:, [0, 1, 2]], QUADS[:, [0, 2, 3]], TRIANGLES])


def check(path: Path, count: int = 12, area: float = AREA) -> None:
    mesh = read_mesh(path)
    assert len(mesh.faces) == count and mesh.area() == pytest.approx(area, rel=1e-3)
    np.testing.assert_allclose(np.ptp(mesh.bounds, axis=0), SIZE, rtol=1e-3)
    assert np.ptp(read_scan(path), axis=0) == pytest.approx(SIZE, abs=0.02)


# ---- PLY


def ply(order: str, body: bytes, *elements: str) -> bytes:
    kind = {"<": "binary_little_endian", ">": "binary_big_endian", "": "ascii"}[order]
    return "\n".join(["ply", f"format {kind} 1.0", *elements, "end_header", ""]).encode() + body


VERTEX = ["element vertex 8", "property float x", "property float y", "property float z"]
FACE = ["element face 7", "property list uchar int vertex_indices"]


def packed(order: str) -> tuple[bytes, bytes]:
    """The vertices, and five quads and two triangles."""
    faces = [struct.pack(f"{order}B{len(f)}i", len(f), *f) for f in [*QUADS.tolist(), *TRIANGLES.tolist()]]
    return VERTICES.astype(f"{order}f4").tobytes(), b"".join(faces)


@pytest.mark.parametrize("order", ["<", ">"])
def test_binary_ply_of_polygons_of_several_sizes(tmp_path, order):
    points, faces = packed(order)
    path = tmp_path / "a.ply"
    path.write_bytes(ply(order, points + faces, *VERTEX, *FACE))
    check(path)
    path.write_bytes(ply(order, points + faces + b"\0", *VERTEX, *FACE))  # a byte behind the end
    check(path)
    upper = [line.replace(" x", " X").replace(" y", " Y").replace(" z", " Z") for line in VERTEX]
    path.write_bytes(ply(order, points + faces, *upper, *FACE).replace(b"\n", b"\r\n", 14))
    check(path)
    colours = ["element edge 2", *(f"property {k} {n}" for k, n in (("int", "vertex1"), ("int", "vertex2")))]
    colours += ["property uchar red"]
    path.write_bytes(ply(order, points + faces + bytes(18), *VERTEX, *FACE, *colours))
    check(path)
    for cut in (1, 9, len(faces) - 1):
        path.write_bytes(ply(order, (points + faces)[:-cut], *VERTEX, *FACE))
        with pytest.raises(MeshError, match=r"a\.ply: the file is cut short in its 7 face records"):
            read_mesh(path)


@pytest.mark.parametrize("order", ["<", ">"])
def test_ply_lists_anywhere(tmp_path, order):
    _, faces = packed(order)
    rows = b"".join(struct.pack(f"{order}3fB{i % 3}i", *VERTICES[i], i % 3, *range(i % 3)) for i in range(8))
    before = struct.pack(f"{order}B2fB0f", 2, 1.0, 2.0, 0)
    head = ["element camera 2", "property list uchar float view", *VERTEX, "property list uchar int seen", *FACE]
    (tmp_path / "a.ply").write_bytes(ply(order, before + rows + faces, *head))
    check(tmp_path / "a.ply")
    text = "2 1 2\n0\n" + "".join(
        f"{x} {y} {z} {i % 3} {' '.join('9' * (i % 3))}\n" for i, (x, y, z) in enumerate(VERTICES.tolist())
    )
    text += "".join(f"{len(f)} {' '.join(map(str, f))}\n" for f in [*QUADS.tolist(), *TRIANGLES.tolist()])
    for ending in ("\n", "\r\n"):
        (tmp_path / "a.ply").write_bytes(ply("", text.encode(), *head).replace(b"\n", ending.encode()))
        check(tmp_path / "a.ply")
    (tmp_path / "a.ply").write_bytes(ply("", text.rsplit("\n", 3)[0].encode(), *head))
    with pytest.raises(MeshError, match="cut short in its 7 face records"):
        read_mesh(tmp_path / "a.ply")


def test_ply_text_of_old_macintoshes(tmp_path):
    text = "".join(f"{x} {y} {z}\n" for x, y, z in VERTICES.tolist())
    text += "".join(f"{len(f)} {' '.join(map(str, f))}\n" for f in [*QUADS.tolist(), *TRIANGLES.tolist()])
    (tmp_path / "a.ply").write_bytes(ply("", text.encode(), *VERTEX, *FACE).replace(b"\n", b"\r"))
    check(tmp_path / "a.ply")


def test_ply_strips_wind_one_way(tmp_path):
    strips = [4, 0, 5, 1, 7, 3, -1, 0, 1, 2, 3, -1, 4, 6, 5, 7, -1, 2, 3, 6, 7, -1, 0, 2, 4, 6]
    head = [*VERTEX, "element tristrips 1", "property list int int vertex_indices"]
    body = VERTICES.astype("<f4").tobytes() + struct.pack(f"<i{len(strips)}i", len(strips), *strips)
    (tmp_path / "a.ply").write_bytes(ply("<", body, *head))
    check(tmp_path / "a.ply")
    # The triangles of one strip, a flat one, all have the same normal.
    mesh = read_geometry(tmp_path / "a.ply")
    corners = mesh.vertices[mesh.faces[4:6]]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    np.testing.assert_allclose(normals[0], normals[1])


# ---- OBJ, OFF, STL


def obj_text() -> str:
    lines = [f"v {x} {y} {z}" for x, y, z in VERTICES.tolist()]
    return "\n".join([*lines, *("f " + " ".join(str(i + 1) for i in f) for f in ALL.tolist())]) + "\n"


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("comment", lambda text: text.replace("\n", " # corner\n").encode()),
        ("glued comment", lambda text: text.replace("\n", "#1\n").encode()),
        ("mark", lambda text: b"\xef\xbb\xbf" + text.encode()),
        ("returns", lambda text: text.replace("\n", "\r").encode()),
        ("utf-16", lambda text: text.encode("utf-16")),
        ("utf-16 without mark", lambda text: text.encode("utf-16-le")),
        ("big utf-16 without mark", lambda text: text.encode("utf-16-be")),
        ("utf-32", lambda text: text.encode("utf-32")),
        ("decimal commas", lambda text: text.replace(".", ",").encode()),
        ("no last line feed", lambda text: text.rstrip().encode()),
        ("old name of faces", lambda text: text.replace("f ", "fo ").encode()),
    ],
)
def test_obj_text(tmp_path, name, change):
    (tmp_path / "a.obj").write_bytes(change(obj_text()))
    check(tmp_path / "a.obj")


def test_names_in_an_obj_may_hold_number_signs(tmp_path):
    text = obj_text().replace("f 1", "o part#1\nf 1", 1).replace("f 2 6", "o part#2\nf 2 6", 1)
    (tmp_path / "a.obj").write_text(text)
    assert len(np.unique(read_mesh(tmp_path / "a.obj").face_parts)) == 2


def off_text() -> str:
    lines = ["OFF", "8 12 0", *(f"{x} {y} {z}" for x, y, z in VERTICES.tolist())]
    return "\n".join([*lines, *(f"3 {a} {b} {c}" for a, b, c in ALL.tolist())]) + "\n"


@pytest.mark.parametrize(
    "text",
    [
        off_text().replace("OFF\n", ""),
        off_text().replace("\n", " "),
        off_text().replace("OFF", "off"),
        off_text().replace("OFF\n", "OFF "),
        off_text().replace("OFF\n", "OFF"),
        "\ufeff" + off_text(),
        off_text().replace("\n", "\r"),
        off_text().replace("\n3 ", " 255 0 0\n3 "),
        off_text().replace("0\n", "0 # corner\n"),
    ],
)
def test_off_text(tmp_path, text):
    (tmp_path / "a.off").write_bytes(text.encode())
    check(tmp_path / "a.off")


def test_off_in_free_form_is_not_read_when_numbers_are_left_over(tmp_path):
    (tmp_path / "a.off").write_text(off_text().replace("\n", " ") + "7")
    with pytest.raises(MeshError, match="damaged or cut short"):
        read_mesh(tmp_path / "a.off")


def stl_text() -> str:
    facets = []
    for face in VERTICES[ALL].tolist():
        loop = "".join(f"vertex {x:e} {y:e} {z:e}\n" for x, y, z in face)
        facets.append(f"facet normal 0 0 0\nouter loop\n{loop}endloop\nendfacet\n")
    return "solid box\n" + "".join(facets) + "endsolid box\n"


def stl_bytes(count: int = 12, head: bytes = b"") -> bytes:
    records = np.zeros(12, [("n", "<f4", 3), ("v", "<f4", (3, 3)), ("a", "<u2")])
    records["v"] = VERTICES[ALL]
    return head.ljust(80, b" ") + struct.pack("<I", count) + records.tobytes()


@pytest.mark.parametrize(
    "data",
    [
        stl_text().encode(),
        stl_text().replace("endsolid", "end solid").encode(),
        stl_text().upper().replace("E+", "e+").encode(),
        stl_text().replace("\n", "\r").encode(),
        stl_text().encode("utf-16"),
        stl_text().replace(".", ",").encode(),
        stl_bytes(),
        stl_bytes(head=b"solid made by a program that writes binary"),
        stl_bytes() + b"trailing",
        stl_bytes(count=0),
    ],
)
def test_stl(tmp_path, data):
    (tmp_path / "a.stl").write_bytes(data)
    check(tmp_path / "a.stl")
    assert len(read_mesh(tmp_path / "a.stl").vertices) == 8


@pytest.mark.parametrize("data", [stl_text()[:900].encode(), stl_bytes()[:-1], stl_bytes(count=13)])
def test_stl_that_is_cut_short(tmp_path, data):
    (tmp_path / "a.stl").write_bytes(data)
    with pytest.raises(MeshError, match="not a whole STL file"):
        read_mesh(tmp_path / "a.stl")


# ---- glTF


def gltf(accessors: list[dict], data: bytes, **more: object) -> dict:
    """A glTF of one mesh: accessor 0 has the positions, accessor 1 the indices; each entry says its bytes."""
    views = []
    for accessor in accessors:
        start, end = accessor.pop("bytes")
        views.append({"buffer": 0, "byteOffset": start, "byteLength": end - start})
        accessor["bufferView"] = len(views) - 1
    content: dict = {
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": len(data)}],
        "bufferViews": views,
        "accessors": accessors,
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0]}],
        "scene": 0,
    }
    return content | more


def write_glb(path: Path, content: dict, data: bytes) -> None:
    text = json.dumps(content).encode()
    text += b" " * (-len(text) % 4)
    data += bytes(-len(data) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(data), b"BIN\0") + data
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)


POSITIONS, INDICES = VERTICES.astype("<f4").tobytes(), ALL.astype("<u2").tobytes()
PLAIN = POSITIONS + INDICES


def plain_accessors() -> list[dict]:
    return [
        {"componentType": 5126, "type": "VEC3", "count": 8, "bytes": (0, 96)},
        {"componentType": 5123, "type": "SCALAR", "count": 36, "bytes": (96, 168)},
    ]


def test_gltf_plain_and_in_a_data_uri_and_percent_encoded(tmp_path):
    content = gltf(plain_accessors(), PLAIN)
    write_glb(tmp_path / "a.glb", content, PLAIN)
    check(tmp_path / "a.glb")
    content["buffers"][0]["uri"] = "data:application/octet-stream;base64," + base64.b64encode(PLAIN).decode()
    (tmp_path / "a.gltf").write_text(json.dumps(content))
    check(tmp_path / "a.gltf")
    (tmp_path / "my chäir.bin").write_bytes(PLAIN)
    for uri in ("my%20ch%C3%A4ir.bin", "my chäir.bin"):
        content["buffers"][0]["uri"] = uri
        (tmp_path / "a.gltf").write_text("\ufeff" + json.dumps(content))
        check(tmp_path / "a.gltf")


@pytest.mark.parametrize("uri", ["../secret.bin", "%2e%2e/secret.bin", "/etc/passwd", "https://example.org/a.bin"])
def test_gltf_reads_nothing_outside_of_its_folder(tmp_path, uri):
    (tmp_path / "in").mkdir()
    (tmp_path / "secret.bin").write_bytes(PLAIN)
    content = gltf(plain_accessors(), PLAIN)
    content["buffers"][0]["uri"] = uri
    (tmp_path / "in" / "a.gltf").write_text(json.dumps(content))
    with pytest.raises(MeshError, match="outside of its folder|which is not read"):
        read_mesh(tmp_path / "in" / "a.gltf")


def test_gltf_follows_links_within_its_folder_alone(tmp_path):
    content = gltf(plain_accessors(), PLAIN) | {"buffers": [{"byteLength": len(PLAIN), "uri": "a.bin"}]}
    folder = tmp_path / "model"
    folder.mkdir()
    (folder / "a.gltf").write_text(json.dumps(content))
    for place in (folder / "real.bin", tmp_path / "secret.bin"):
        place.write_bytes(PLAIN)
        (folder / "a.bin").unlink(missing_ok=True)
        (folder / "a.bin").symlink_to(place)
        if place.parent == folder:
            check(folder / "a.gltf")
    with pytest.raises(MeshError, match="lies outside of its folder"):
        read_mesh(folder / "a.gltf")
    # Stores of files by their content: both are links into one folder.
    (tmp_path / "b.gltf").write_text(json.dumps(content))
    (folder / "a.gltf").unlink()
    (folder / "a.gltf").symlink_to(tmp_path / "b.gltf")
    check(folder / "a.gltf")


@pytest.mark.parametrize(("component", "dtype"), [(5120, "i1"), (5121, "u1"), (5122, "<i2"), (5123, "<u2")])
def test_normalised_integers_are_fractions(tmp_path, component, dtype):
    top = np.iinfo(dtype).max
    data = (VERTICES / 2 * top).round().astype(dtype).tobytes()
    data += bytes(-len(data) % 4)
    accessors = plain_accessors()
    accessors[0] = {"componentType": component, "normalized": True, "type": "VEC3", "count": 8, "bytes": (0, len(data))}
    accessors[1]["bytes"] = (len(data), len(data) + 72)
    nodes = [{"mesh": 0, "scale": [2, 2, 2]}]
    content = gltf(accessors, data + INDICES, nodes=nodes, extensionsRequired=["KHR_mesh_quantization"])
    write_glb(tmp_path / "a.glb", content, data + INDICES)
    mesh = read_mesh(tmp_path / "a.glb")
    np.testing.assert_allclose(mesh.bounds, [[0, 0, 0], SIZE], atol=2 / top)


def test_sparse_accessors(tmp_path):
    changed = np.array([6, 7], "<u2").tobytes() + VERTICES[6:].astype("<f4").tobytes()
    wrong = VERTICES.copy()
    wrong[6:] = 99
    data = wrong.astype("<f4").tobytes() + INDICES + changed
    accessors = plain_accessors()
    content = gltf(accessors, data)
    content["bufferViews"] += [
        {"buffer": 0, "byteOffset": 168, "byteLength": 4},
        {"buffer": 0, "byteOffset": 172, "byteLength": 24},
    ]
    accessors[0]["sparse"] = {
        "count": 2,
        "indices": {"bufferView": 2, "componentType": 5123},
        "values": {"bufferView": 3},
    }
    write_glb(tmp_path / "a.glb", content, data)
    check(tmp_path / "a.glb")
    # Without a view of its own an accessor begins as zeros.
    full = np.arange(8, dtype="<u2").tobytes() + POSITIONS
    content["bufferViews"][2:] = [
        {"buffer": 0, "byteOffset": 72, "byteLength": 16},
        {"buffer": 0, "byteOffset": 88, "byteLength": 96},
    ]
    content["bufferViews"][1]["byteOffset"] = 0
    accessors[0]["sparse"]["count"] = 8
    del accessors[0]["bufferView"]
    write_glb(tmp_path / "a.glb", content, INDICES + full)
    check(tmp_path / "a.glb")


def test_fans_strips_points_and_unindexed_triangles(tmp_path):
    fans = np.array([0, 1, 3, 2], "<u2"), np.array([4, 6, 7, 5], "<u2")
    strips = np.array([0, 1, 4, 5], "<u2"), np.array([2, 3, 6, 7], "<u2"), np.array([0, 2, 4, 6], "<u2")
    rest = np.array([1, 5, 7, 1, 7, 3], "<u2")
    data = POSITIONS
    accessors = plain_accessors()[:1]
    primitives = []
    for mode, part in [(6, fans[0]), (6, fans[1]), *((5, strip) for strip in strips), (4, rest), (0, rest), (1, rest)]:
        accessors.append(
            {
                "componentType": 5123,
                "type": "SCALAR",
                "count": len(part),
                "bytes": (len(data), len(data) + part.nbytes),
            }
        )
        primitives.append({"attributes": {"POSITION": 0}, "indices": len(accessors) - 1, "mode": mode})
        data += part.tobytes()
    content = gltf(accessors, data, meshes=[{"primitives": primitives}])
    write_glb(tmp_path / "a.glb", content, data)
    check(tmp_path / "a.glb")
    soup = VERTICES[ALL].astype("<f4").tobytes()
    accessors = [{"componentType": 5126, "type": "VEC3", "count": 36, "bytes": (0, len(soup))}]
    content = gltf(accessors, soup, meshes=[{"primitives": [{"attributes": {"POSITION": 0}}]}])
    write_glb(tmp_path / "a.glb", content, soup)
    check(tmp_path / "a.glb")


def test_instances_stand_where_they_are_put(tmp_path):
    places = np.array([[0, 0, 0], [10, 0, 0], [0, 20, 0]], "<f4")
    accessors = [*plain_accessors(), {"componentType": 5126, "type": "VEC3", "count": 3, "bytes": (168, 204)}]
    extension = {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 2}}}
    content = gltf(
        accessors,
        PLAIN + places.tobytes(),
        nodes=[{"mesh": 0, "extensions": extension}],
        extensionsRequired=["EXT_mesh_gpu_instancing"],
    )
    write_glb(tmp_path / "a.glb", content, PLAIN + places.tobytes())
    mesh = read_mesh(tmp_path / "a.glb")
    assert len(mesh.faces) == 36 and mesh.area() == pytest.approx(3 * AREA)
    np.testing.assert_allclose(mesh.bounds, [[0, 0, 0], [12, 21, 0.5]])
    assert len(np.unique(mesh.face_parts)) == 3


def test_nodes_are_placed_by_all_above_them_and_other_scenes_are_left_out(tmp_path):
    turn = [[0, 0, 0.5**0.5, 0.5**0.5], [0.0, 1.0, 0.0]]  # about z, by 90 degrees
    nodes = [
        {"children": [1], "rotation": turn[0]},
        {"mesh": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, *[5, 0, 0], 1]},
        {"mesh": 0, "translation": [100, 0, 0]},
    ]
    content = gltf(plain_accessors(), PLAIN, nodes=nodes, scenes=[{"nodes": [2]}, {"nodes": [0]}], scene=1)
    write_glb(tmp_path / "a.glb", content, PLAIN)
    np.testing.assert_allclose(read_mesh(tmp_path / "a.glb").bounds, [[-1, 5, 0], [0, 7, 0.5]], atol=1e-6)
    del content["scenes"], content["scene"]
    write_glb(tmp_path / "a.glb", content, PLAIN)
    assert len(read_mesh(tmp_path / "a.glb").faces) == 24


def test_draco(tmp_path):
    DracoPy = pytest.importorskip("DracoPy")
    data = DracoPy.encode(VERTICES.astype(np.float32), ALL.astype(np.uint32), quantization_bits=14)
    extension = {"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {"POSITION": 0}}}
    accessors = plain_accessors()
    primitive = {"attributes": {"POSITION": 0}, "indices": 1, "extensions": extension}
    content = gltf(
        accessors, data, meshes=[{"primitives": [primitive]}], extensionsRequired=["KHR_draco_mesh_compression"]
    )
    content["bufferViews"] = [{"buffer": 0, "byteLength": len(data)}]
    for accessor in accessors:
        del accessor["bufferView"]
    write_glb(tmp_path / "a.glb", content, data)
    check(tmp_path / "a.glb")
    write_glb(tmp_path / "a.glb", content, bytes(len(data)))
    for reader in (read_mesh, read_scan):
        with pytest.raises(Exception, match=r"a\.glb: its KHR_draco_mesh_compression data cannot be decoded"):
            reader(tmp_path / "a.glb")


def test_meshopt(tmp_path):
    meshoptimizer = pytest.importorskip("meshoptimizer")
    vertices = bytes(meshoptimizer.encode_vertex_buffer(VERTICES.astype(np.float32), 8, 12))
    indices = bytes(meshoptimizer.encode_index_buffer(ALL.astype(np.uint32).ravel(), 36, 8))
    data = vertices + indices
    content = gltf(plain_accessors(), data, extensionsRequired=["EXT_meshopt_compression"])
    content["buffers"].append({"byteLength": 168, "extensions": {"EXT_meshopt_compression": {"fallback": True}}})
    spans = [(0, len(vertices), 12, "ATTRIBUTES", 8), (len(vertices), len(indices), 2, "TRIANGLES", 36)]
    for view, (start, length, stride, mode, count) in zip(content["bufferViews"], spans, strict=True):
        packed_view = {"buffer": 0, "byteOffset": start, "byteLength": length, "byteStride": stride}
        view |= {"buffer": 1, "extensions": {"EXT_meshopt_compression": packed_view | {"mode": mode, "count": count}}}
    write_glb(tmp_path / "a.glb", content, data)
    check(tmp_path / "a.glb")
    write_glb(tmp_path / "a.glb", content, bytes(len(data)))
    with pytest.raises(MeshError, match=r"a\.glb: its EXT_meshopt_compression data cannot be decoded"):
        read_mesh(tmp_path / "a.glb")
    # What would grow too much is refused before it is decoded.
    packed = content["bufferViews"][0]["extensions"]["EXT_meshopt_compression"]
    packed["count"] = 100_000_000
    write_glb(tmp_path / "a.glb", content, data)
    with pytest.raises(MeshError, match=r"a\.glb: its EXT_meshopt_compression data is damaged"):
        read_mesh(tmp_path / "a.glb")


def test_arrays_without_data_have_a_limit(tmp_path):
    content = gltf(plain_accessors(), PLAIN)
    del content["accessors"][0]["bufferView"]
    content["accessors"][0]["count"] = (1 << 26) + 1
    write_glb(tmp_path / "a.glb", content, PLAIN)
    with pytest.raises(MeshError, match="has 67108865 entries and no data"):
        read_geometry(tmp_path / "a.glb")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"extensionsRequired": ["EXT_unheard_of"]}, "needs EXT_unheard_of"),
        ({"nodes": [{"mesh": 7}]}, "meshes 7, which is not there"),
        ({"nodes": [{"mesh": 0, "children": [0]}]}, "two parents"),
        ({"nodes": [{"mesh": 0, "translation": [1, float("nan"), 0]}]}, "broken transform"),
        ({"meshes": [{"primitives": [{"attributes": {}}]}]}, "no positions"),
        ({"meshes": [{"primitives": [{"attributes": {"POSITION": 1}}]}]}, "three coordinates"),
        ({"buffers": [{"byteLength": 168, "uri": "none.bin"}]}, "'none.bin' is not beside it"),
    ],
)
def test_gltf_that_cannot_be_read_says_why(tmp_path, change, words):
    write_glb(tmp_path / "a.glb", gltf(plain_accessors(), PLAIN) | change, PLAIN)
    with pytest.raises(MeshError, match=rf"a\.glb: .*{words}"):
        read_mesh(tmp_path / "a.glb")


def test_polygons_of_very_many_corners_are_cut_at_once(tmp_path):
    """Ear clipping one after the other would take hours for such a spiral."""
    turn = np.linspace(0, 40 * np.pi, 20_000)
    outer, inner = 1 + turn / 10, 0.9 + turn / 10
    spiral = np.concatenate(
        [np.stack([r * np.cos(t), r * np.sin(t)], 1) for r, t in ((outer, turn), (inner[::-1], turn[::-1]))]
    )
    lines = [f"v {x} {y} 0" for x, y in spiral.tolist()] + ["f " + " ".join(map(str, range(1, len(spiral) + 1)))]
    (tmp_path / "a.obj").write_text("\n".join(lines))
    x, y = spiral.T
    wanted = 0.5 * abs((x * np.roll(y, -1) - np.roll(x, -1) * y).sum())
    assert read_mesh(tmp_path / "a.obj").area() == pytest.approx(wanted, rel=0.01)


def test_many_polygons_of_many_corners_are_cut_as_fans_in_the_end():
    """Clipping is quadratic at worst: after some polygons of a file, no more of them are clipped."""
    angle = np.linspace(0, 2 * np.pi, 30_000, endpoint=False)
    ring = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
    count = 3
    faces, polygon = triangulate(
        np.tile(ring, (count, 1)), np.arange(count * len(ring)), np.full(count, len(ring), dtype=np.int64)
    )
    fans = [(faces[polygon == number][:, 0] == number * len(ring)).all() for number in range(count)]
    assert fans == [False, False, True]


# ---- skins


def skinned(joints: list[list[int]], inverse: np.ndarray) -> tuple[dict, bytes]:
    """The box with a skin of two joints; the second stands 5 to the right of where it was when the skin was made."""
    weights = np.zeros((8, 4), "<f4")
    weights[:, 0] = 1
    parts = [PLAIN, np.array(joints, "u1").tobytes(), weights.tobytes(), inverse.astype("<f4").tobytes()]
    ends = np.cumsum([0, *map(len, parts)]).tolist()
    more = [
        {"componentType": 5121, "type": "VEC4", "count": 8, "bytes": (ends[1], ends[2])},
        {"componentType": 5126, "type": "VEC4", "count": 8, "bytes": (ends[2], ends[3])},
        {"componentType": 5126, "type": "MAT4", "count": 2, "bytes": (ends[3], ends[4])},
    ]
    data = b"".join(parts)
    content = gltf(plain_accessors() + more, data)
    content["meshes"][0]["primitives"][0]["attributes"] |= {"JOINTS_0": 2, "WEIGHTS_0": 3}
    content["nodes"] = [
        {"mesh": 0, "skin": 0, "translation": [50, 0, 0]},
        {"translation": [1, 2, 3]},
        {"translation": [6, 2, 3]},
    ]
    content["scenes"] = [{"nodes": [0, 1, 2]}]
    content["skins"] = [{"joints": [1, 2], "inverseBindMatrices": 4}]
    return content, data


def test_skinned_meshes_stand_where_their_joints_put_them(tmp_path):
    bind = np.tile(np.eye(4), (2, 1, 1))
    bind[:, :3, 3] = [-1, -2, -3]
    joints = [[row % 2, 0, 0, 0] for row in range(8)]
    write_glb(tmp_path / "a.glb", *skinned(joints, bind.transpose(0, 2, 1)))
    found = read_geometry(tmp_path / "a.glb")
    expected = VERTICES + np.array([[5.0 * (row % 2), 0, 0] for row in range(8)])
    np.testing.assert_allclose(found.vertices, expected, atol=1e-6)


@pytest.mark.parametrize("fault", ["a joint that is not there", "no weights"])
def test_meshes_with_damaged_skins_stand_at_their_nodes(tmp_path, fault):
    joints = [[9 if fault.startswith("a joint") else 0, 0, 0, 0]] * 8
    content, data = skinned(joints, np.tile(np.eye(4), (2, 1, 1)))
    if fault == "no weights":
        del content["meshes"][0]["primitives"][0]["attributes"]["WEIGHTS_0"]
    write_glb(tmp_path / "a.glb", content, data)
    np.testing.assert_allclose(read_geometry(tmp_path / "a.glb").vertices, VERTICES + [50, 0, 0], atol=1e-5)


@pytest.mark.parametrize("name", ["FB_ngon_encoding", "KHR_materials_unlit", "EXT_texture_webp", "KHR_lights_punctual"])
def test_extensions_without_geometry_may_be_required(tmp_path, name):
    write_glb(tmp_path / "a.glb", gltf(plain_accessors(), PLAIN, extensionsRequired=[name]), PLAIN)
    check(tmp_path / "a.glb")


def test_obj_in_capitals_and_with_whole_floats_for_numbers(tmp_path):
    lines = [f"V {x} {y} {z}" for x, y, z in VERTICES.tolist()]
    lines += [f"F {a}.0 {b}.0 {c}.0" for a, b, c in (ALL + 1).tolist()]
    (tmp_path / "a.obj").write_text("\n".join(lines))
    check(tmp_path / "a.obj")
    (tmp_path / "a.obj").write_text("\n".join(lines).replace("F 1.0", "F 1.5"))
    with pytest.raises(MeshError, match="not a proper OBJ line"):
        read_geometry(tmp_path / "a.obj")
