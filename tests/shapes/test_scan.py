import struct
import tracemalloc

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from kpred.errors import ConfigError, ScanError
from kpred.shapes.formats.lzf import decompress_lzf
from kpred.shapes.mesh import Mesh
from kpred.shapes.mesh_io import write_mesh
from kpred.shapes.scan import SURFACE_SAMPLES, ScanWarning, check_points, read_scan


@pytest.fixture
def cloud(rng) -> np.ndarray:
    return rng.normal(size=(500, 3)).astype(np.float32).astype(np.float64)


# ---- text


@pytest.mark.parametrize(
    ("name", "header", "separator", "order"),
    [
        ("a.xyz", "", " ", "xyz"),
        ("a.txt", "# a comment\n\n", "\t", "xyzn"),
        ("a.csv", "x,y,z,label\n", ",", "xyzn"),
        ("b.csv", '"id","Z","X","Y"\n', ", ", "nzxy"),
        ("c.csv", "//X;Y;Z;R\n", ";", "xyzn"),
        ("a.pts", "500\n", " ", "xyznn"),
        ("b.pts", "", " ", "xyzn"),
        ("a.asc", "\ufeff# exported\n# x y z\n", "  ", "xyz"),
    ],
)
def test_text_of_every_layout(tmp_path, cloud, name, header, separator, order):
    columns = {"x": cloud[:, 0], "y": cloud[:, 1], "z": cloud[:, 2], "n": np.arange(500)}
    rows = zip(*(columns[c].tolist() for c in order), strict=True)
    text = header + "\n".join(separator.join(map(repr, row)) for row in rows)
    for ending in ("", "\n", "\r\n"):
        (tmp_path / name).write_bytes(text.replace("\n", ending or "\n").encode() + ending.encode())
        np.testing.assert_array_equal(read_scan(tmp_path / name), cloud)


def test_ragged_lines_words_and_decimal_commas(tmp_path, cloud):
    lines = [" ".join(map(repr, row)) + ("" if i % 3 else " 1 2 # good") for i, row in enumerate(cloud.tolist())]
    (tmp_path / "a.xyz").write_text("\n\n".join(lines))
    np.testing.assert_array_equal(read_scan(tmp_path / "a.xyz"), cloud)
    lines = [",".join([*map(repr, row), "", "chair leg"]) for row in cloud.tolist()]
    (tmp_path / "a.csv").write_text("x,y,z,n,label\n" + "\n".join(lines))
    np.testing.assert_array_equal(read_scan(tmp_path / "a.csv"), cloud)
    (tmp_path / "b.csv").write_text("\n".join(f"{x};{y};{z}".replace(".", ",") for x, y, z in cloud.tolist()))
    np.testing.assert_array_equal(read_scan(tmp_path / "b.csv"), cloud)


def test_rows_whose_widths_only_add_up_are_not_shifted(tmp_path, cloud):
    lines = [" ".join(map(repr, row)) for row in cloud.tolist()]
    lines[100] += " 7"
    lines[200] = "1 2"
    (tmp_path / "a.xyz").write_text("\n".join(lines))
    with pytest.raises(ScanError, match=r"a\.xyz: line 201 does not hold x, y and z"):
        read_scan(tmp_path / "a.xyz")


# ---- numpy


def test_numpy_files(tmp_path, cloud):
    wide = np.concatenate([cloud, cloud], axis=1)
    for array in (cloud, wide, np.asfortranarray(wide), cloud.astype(np.float32), cloud.astype(">f8")):
        np.save(tmp_path / "a.npy", array)
        np.testing.assert_array_equal(read_scan(tmp_path / "a.npy"), cloud)
    for key in ("points", "xyz", "vertices"):
        np.savez_compressed(tmp_path / "a.npz", **{key: cloud, "colour": wide})
        np.testing.assert_array_equal(read_scan(tmp_path / "a.npz"), cloud)
    np.savez(tmp_path / "a.npz", scan=cloud)
    np.testing.assert_array_equal(read_scan(tmp_path / "a.npz"), cloud)


# ---- PLY


def ply_bytes(points: np.ndarray, kind: str, coordinate: str = "double", before: bool = False) -> bytes:
    order = {"ascii": "<", "binary_little_endian": "<", "binary_big_endian": ">"}[kind]
    real = {"double": "f8", "float": "f4"}[coordinate]
    head = f"ply\nformat {kind} 1.0\ncomment made by a test\n"
    if before:
        head += "element camera 2\nproperty float view\nproperty uchar id\n"
    head += f"element vertex {len(points)}\nproperty uchar red\n"
    head += "".join(f"property {coordinate} {axis}\n" for axis in "yxz") + "property float nx\nend_header\n"
    if kind == "ascii":
        body = "1 2\n3 4\n" if before else ""
        return (head + body + "".join(f"9 {y!r} {x!r} {z!r} 0.5\n" for x, y, z in points.tolist())).encode()
    records = np.zeros(len(points), [("r", "u1"), *((a, order + real) for a in "yxz"), ("n", order + "f4")])
    for i, axis in enumerate("xyz"):
        records[axis] = points[:, i]
    return head.encode() + (bytes(10) if before else b"") + records.tobytes()


@pytest.mark.parametrize("kind", ["ascii", "binary_little_endian", "binary_big_endian"])
@pytest.mark.parametrize("before", [False, True])
def test_ply_clouds(tmp_path, cloud, kind, before):
    path = tmp_path / "a.ply"
    for coordinate in ("float", "double"):
        path.write_bytes(ply_bytes(cloud, kind, coordinate, before))
        np.testing.assert_array_equal(read_scan(path), cloud)
    data = path.read_bytes()
    path.write_bytes(data[: len(data) * 2 // 3])
    with pytest.raises(ScanError, match=r"a\.ply.*(cut short|does not hold)"):
        read_scan(path)
    path.write_bytes(data[:60])
    with pytest.raises(ScanError, match="header is damaged"):
        read_scan(path)


def test_coordinates_far_from_the_origin_keep_their_precision(tmp_path, cloud):
    far = cloud + [500_000.125, 5_400_000.25, 312.5]
    (tmp_path / "a.ply").write_bytes(ply_bytes(far, "binary_little_endian"))
    (tmp_path / "a.xyz").write_text("\n".join(" ".join(map(repr, row)) for row in far.tolist()))
    (tmp_path / "a.obj").write_text("".join("v {!r} {!r} {!r}\n".format(*row) for row in far.tolist()))
    for name in ("a.ply", "a.xyz", "a.obj"):
        np.testing.assert_array_equal(read_scan(tmp_path / name), far)


# ---- PCD


def lzf_compress(data: bytes) -> bytes:
    """Greedy LZF: three-byte matches by a table; literals in runs of at most 32."""
    out, literals, table, at = bytearray(), bytearray(), {}, 0

    def flush() -> None:
        for start in range(0, len(literals), 32):
            run = literals[start : start + 32]
            out.append(len(run) - 1)
            out.extend(run)
        literals.clear()

    while at < len(data):
        key = data[at : at + 3]
        found = table.get(key) if len(key) == 3 else None
        table[key] = at
        if found is None or at - found > 8192:
            literals.append(data[at])
            at += 1
            continue
        length = 3
        while length < 264 and at + length < len(data) and data[found + length] == data[at + length]:
            length += 1
        flush()
        distance, coded = at - found - 1, length - 2
        if coded < 7:
            out.append((coded << 5) | (distance >> 8))
        else:
            out += bytes([(7 << 5) | (distance >> 8), coded - 7])
        out.append(distance & 255)
        at += length
    flush()
    return bytes(out)


@given(st.lists(st.sampled_from([b"a", b"bc", b"\x00" * 50, b"abcabc", b"xyz" * 100]), max_size=60))
def test_lzf_comes_back(pieces):
    data = b"".join(pieces)
    assert decompress_lzf(lzf_compress(data), len(data)) == data


@pytest.mark.parametrize("bad", [b"\x05ab", b"\x20\x00", b"\xe0", b"\x00a\x20"])
def test_damaged_lzf_is_refused(bad):
    with pytest.raises(ValueError):
        decompress_lzf(bad, 100)


def pcd_bytes(points: np.ndarray, data: str, height: int = 1, real: str = "f4") -> bytes:
    size = real[1]
    head = (
        "# .PCD v0.7\nVERSION 0.7\nFIELDS rgb x y _ z fpfh _\n"
        f"SIZE 4 {size} {size} 1 {size} 4 2\nTYPE U F F U F F I\nCOUNT 1 1 1 3 1 2 1\n"
        f"WIDTH {len(points) // height}\nHEIGHT {height}\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {len(points)}\nDATA {data}\n"
    ).encode()
    if data == "ascii":
        return head + "".join(f"7 {x!r} {y!r} 0 0 0 {z!r} 1 2 3\n" for x, y, z in points.tolist()).encode()
    entries = [
        ("c", "u4", 1),
        ("x", real, 1),
        ("y", real, 1),
        ("p", "u1", 3),
        ("z", real, 1),
        ("f", "f4", 2),
        ("q", "i2", 1),
    ]
    records = np.zeros(len(points), [(n, f"<{k}", (c,)) for n, k, c in entries])
    for i, axis in enumerate("xyz"):
        records[axis] = points[:, i : i + 1]
    if data == "binary":
        return head + records.tobytes()
    body = b"".join(records[name].tobytes() for name, _, _ in entries)
    packed = lzf_compress(body)
    return head + struct.pack("<II", len(packed), len(body)) + packed


@pytest.mark.parametrize("data", ["ascii", "binary", "binary_compressed"])
@pytest.mark.parametrize("real", ["f4", "f8"])
def test_pcd_clouds(tmp_path, cloud, data, real):
    path = tmp_path / "a.pcd"
    path.write_bytes(pcd_bytes(cloud, data, real=real))
    np.testing.assert_array_equal(read_scan(path), cloud)
    whole = path.read_bytes()
    for share in (0.4, 0.9):
        path.write_bytes(whole[: int(len(whole) * share)])
        with pytest.raises(ScanError, match=r"a\.pcd.*(cut short|damaged|does not hold)"):
            read_scan(path)


@pytest.mark.parametrize("height", [1, 20])
@pytest.mark.parametrize("data", ["ascii", "binary", "binary_compressed"])
def test_clouds_may_be_mostly_nan(tmp_path, cloud, data, height):
    rays = np.full((2000, 3), np.nan)
    rays[::4] = cloud
    (tmp_path / "a.pcd").write_bytes(pcd_bytes(rays, data, height=height))
    with pytest.warns(ScanWarning, match=r"a\.pcd: 1500 of 2000 points are NaN"):
        np.testing.assert_array_equal(read_scan(tmp_path / "a.pcd"), cloud)


# ---- meshes


@pytest.mark.parametrize("extension", [".ply", ".obj", ".stl", ".off", ".glb"])
def test_large_faces_are_sampled_by_area(tmp_path, extension):
    box = trimesh.creation.box((1, 2, 4))
    write_mesh(tmp_path / f"box{extension}", Mesh(box.vertices, box.faces))
    points = read_scan(tmp_path / f"box{extension}")
    assert points.shape == (SURFACE_SAMPLES, 3)
    half = np.array([0.5, 1, 2])
    distance = np.abs(np.abs(points) - half)
    assert (distance.min(axis=1) < 1e-6).all() and (np.abs(points) <= half + 1e-6).all()
    on_ends = (distance[:, 2] < 1e-6).mean()
    assert on_ends == pytest.approx(2 * 2 / 28, abs=0.01)
    np.testing.assert_array_equal(points, read_scan(tmp_path / f"box{extension}"))
    assert not np.array_equal(points, read_scan(tmp_path / f"box{extension}", seed=1))
    assert len(read_scan(tmp_path / f"box{extension}", max_points=100)) == 100


@pytest.mark.parametrize("extension", [".ply", ".obj", ".off", ".stl", ".glb"])
def test_a_dense_scan_mesh_gives_its_vertices(tmp_path, extension):
    ball = trimesh.creation.icosphere(5)
    mesh = Mesh(ball.vertices, ball.faces)
    write_mesh(tmp_path / f"scan{extension}", mesh)
    points = read_scan(tmp_path / f"scan{extension}")
    assert {tuple(p) for p in points.astype(np.float32)} == {tuple(p) for p in mesh.vertices}


def test_detail_does_not_hide_large_faces(tmp_path):
    knob = trimesh.creation.icosphere(5, radius=0.02)
    door = trimesh.creation.box((1, 2, 0.02))
    write_mesh(tmp_path / "door.obj", trimesh.util.concatenate([door, knob]))
    points = read_scan(tmp_path / "door.obj")
    assert (np.linalg.norm(points, axis=1) > 0.1).mean() > 0.9


# ---- thinning


def test_thinning_is_even_seeded_and_keeps_the_order(tmp_path):
    line = np.arange(300_000, dtype=np.float64)
    np.save(tmp_path / "a.npy", np.stack([line, line % 997 * 300, line % 3], axis=1))
    points = read_scan(tmp_path / "a.npy", max_points=10_000, seed=3)
    assert points.shape == (10_000, 3)
    assert (np.diff(points[:, 0]) > 0).all()
    # 30 equal stretches, 333 expected in each; five standard deviations.
    counts = np.histogram(points[:, 0], bins=30, range=(0, 300_000))[0]
    assert np.abs(counts - 10_000 / 30).max() < 5 * np.sqrt(10_000 / 30)
    np.testing.assert_array_equal(points, read_scan(tmp_path / "a.npy", max_points=10_000, seed=3))
    assert not np.array_equal(points, read_scan(tmp_path / "a.npy", max_points=10_000, seed=4))


def test_two_million_points_stay_within_memory(tmp_path, rng):
    points = rng.normal(size=(2_000_000, 3))
    np.save(tmp_path / "a.npy", points)
    (tmp_path / "a.ply").write_bytes(ply_bytes(points.astype(np.float32), "binary_little_endian", "float"))
    (tmp_path / "a.pcd").write_bytes(pcd_bytes(points, "binary"))
    del points
    for name in ("a.npy", "a.ply", "a.pcd"):
        tracemalloc.start()
        thinned = read_scan(tmp_path / name, max_points=50_000)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert thinned.shape == (50_000, 3)
        assert peak < 24e6, f"{name}: {peak / 1e6:.0f} MB"  # All points are 48 MB.


def test_long_text_stays_within_memory(tmp_path, rng):
    block = "".join("{:.4f} {:.4f} {:.4f} 17\n".format(*row) for row in rng.normal(size=(20_000, 3)).tolist())
    (tmp_path / "a.xyz").write_text(block * 8)
    tracemalloc.start()
    thinned = read_scan(tmp_path / "a.xyz", max_points=1000)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert thinned.shape == (1000, 3) and peak < 20e6  # All lines at once take 44 MB.


# ---- bad input


def test_files_that_are_no_scan_are_named(tmp_path, cloud):
    def refused(name: str, words: str, content: bytes | None) -> None:
        path = tmp_path / name
        if content is not None:
            path.write_bytes(content)
        with pytest.raises(ScanError, match=words) as caught:
            read_scan(path)
        assert name in str(caught.value) and "\n" not in str(caught.value)

    (tmp_path / "folder.ply").mkdir()
    refused("folder.ply", "it is a folder", None)
    refused("none.ply", "no such file", None)
    refused("a.rcp", "unknown scan extension '.rcp'; convert it to", b"RCP")
    for name in ("a.ply", "a.pcd", "a.xyz", "a.npy", "a.npz", "a.obj", "a.glb"):
        refused(name, "the file is empty", b"")
        refused(f"noise{name}", "not|no |damaged|does|0 distinct", b"\x00\x01noise" * 50)
    refused("b.xyz", "no points", b"# nothing\n")
    refused("few.xyz", "3 distinct points", b"0 0 0\n1 0 0\n0 1 0\n")
    refused("words.txt", "line 3 does not hold", b"0 0 0\n1 0 0\nhello you there\n")
    refused("b.pts", "cut short", b"900\n" + b"0 0 0\n" * 100)
    refused("b.ply", "not a PLY", b"solid\n")
    refused("b.pcd", "no fields x, y and z", b"FIELDS a\nSIZE 4\nTYPE F\nCOUNT 1\nWIDTH 1\nPOINTS 1\nDATA ascii\n1\n")
    refused("c.pcd", "header is damaged", b"FIELDS x y z\nDATA ascii\n1\n")
    np.save(tmp_path / "d.npy", cloud[:, :2])
    refused("d.npy", r"shape is \(500, 2\)", None)
    np.save(tmp_path / "e.npy", np.array(["a"]))
    refused("e.npy", "not numbers", None)
    np.save(tmp_path / "f.npy", cloud)
    refused("f.npy", "cut short", (tmp_path / "f.npy").read_bytes()[:3000])
    np.savez(tmp_path / "c.npz", a=cloud, b=cloud)
    refused("c.npz", "none of its arrays", None)
    np.savez(tmp_path / "d.npz", vertices=cloud, vertex_offsets=np.zeros(2))
    refused("d.npz", "pack of many meshes", None)
    np.savez(tmp_path / "e.npz", points=cloud)
    refused("e.npz", "cut short", (tmp_path / "e.npz").read_bytes()[:-40])
    with pytest.raises(ConfigError, match="max_points is 10"):
        read_scan(tmp_path / "f.npy", max_points=10)


def test_points_that_are_no_object_are_refused(cloud):
    with pytest.raises(ScanError, match=r"s\.ply.*shape \(N, 3\)"):
        check_points(cloud[:, :2], "s.ply")
    with pytest.raises(ScanError, match="63 distinct points"):
        check_points(np.repeat(cloud[:63], 9, axis=0))
    with pytest.raises(ScanError, match="1 distinct points"):
        check_points(np.zeros((5000, 3)))
    with pytest.raises(ScanError, match="0 distinct points"):
        check_points(np.zeros((0, 3)))
    line = np.linspace(-1, 1, 500)[:, None] * [1.0, 2.0, -0.5]
    for offset, scale in ((0, 1), (1e5, 1), (0, 1e-6), (0, 1e12)):
        with pytest.raises(ScanError, match="one line"):
            check_points(line * scale + offset)
        flat = cloud * [1, 1, 0]
        assert len(check_points(flat * scale + offset)) == 500
    with pytest.raises(ScanError, match="too large"):
        check_points(cloud / np.abs(cloud).max() * 1.7e308)


def test_invalid_points_are_dropped_while_a_scan_is_left(cloud):
    spoiled = cloud.copy()
    spoiled[::10, 1] = np.nan
    spoiled[5] = np.inf
    np.testing.assert_array_equal(check_points(spoiled), spoiled[np.isfinite(spoiled).all(axis=1)])
    spoiled[:250] = np.nan
    with pytest.warns(ScanWarning, match="275 of 500 points are NaN or infinite"):
        assert len(check_points(spoiled)) == 225
    spoiled[:440] = np.nan
    with pytest.raises(ScanError, match=r"446 of 500 points are NaN or infinite"):
        check_points(spoiled)


def test_late_variety_counts(cloud):
    assert len(check_points(np.concatenate([np.zeros((6000, 3)), cloud]))) == 6500


# ---- real scans


def test_real_crops(shared_data):
    paths = sorted((shared_data / "real").glob("s3dis/*.ply")) + sorted((shared_data / "real").glob("*/pairs/*.ply"))
    assert len(paths) == 34
    for path in paths:
        points = read_scan(path)
        slow = trimesh.load(path, process=False)
        np.testing.assert_array_equal(points, np.asarray(slow.vertices, dtype=np.float64))


def test_a_real_scan_mesh_gives_its_vertices(shared_data):
    path = next((shared_data / "real").glob("*/Assets/scannet-sample/*/*clean_2.ply"))
    slow = trimesh.load(path, process=False)
    points = read_scan(path, max_points=1_000_000)
    np.testing.assert_array_equal(points, np.asarray(slow.vertices))
