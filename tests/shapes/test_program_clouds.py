"""Binary clouds as single programs write them: the same points come back from each, or the reason why not."""

import gzip
import io
import re

import numpy as np
import pytest

from kpred.errors import ScanError
from kpred.shapes.scan import read_scan

COUNT = 128
CLOUD = (np.random.default_rng(5).normal(size=(COUNT, 3)) * [0.4, 0.6, 0.3] + [0.3, -0.2, 1.5]).round(4)
ROWS = [" ".join(map(str, row)) for row in CLOUD.tolist()]


def ply(
    kind: str = "float f4",
    more: tuple[str, ...] = (),
    order: str = "<",
    before: str = "",
    behind: str = "",
    data: tuple[bytes, bytes] = (b"", b""),
    scale: float = 1.0,
    ending: str = "\n",
) -> bytes:
    """A cloud whose vertices have further properties ("float f4 nx"), and other elements before and behind them."""
    word, code = kind.split()
    properties = [(word, code, axis) for axis in "xyz"] + [tuple(item.split()) for item in more]
    lines = [
        "ply",
        f"format binary_{'little' if order == '<' else 'big'}_endian 1.0",
        before,
        f"element vertex {COUNT}",
    ]
    lines += [f"property {word} {name}" for word, _, name in properties] + [behind, "end_header"]
    records = np.zeros(COUNT, [(name, order + code) for _, code, name in properties])
    for column, axis in enumerate("xyz"):
        records[axis] = np.round(CLOUD[:, column] * scale, 4) if code[0] == "f" else np.round(CLOUD[:, column] * scale)
    header = "".join(line + ending for line in lines if line)
    return header.encode() + data[0] + records.tobytes() + data[1]


RGB = tuple(f"uchar u1 {name}" for name in ("red", "green", "blue"))
NORMALS = tuple(f"float f4 {name}" for name in ("nx", "ny", "nz"))
SPLAT = (*NORMALS, *(f"float f4 f_rest_{number}" for number in range(45)), "float f4 opacity", "float f4 scale_0")
CAMERA = "element camera 1\n" + "\n".join(f"property float k{number}" for number in range(21))
GRID = "element range_grid 200\nproperty list uchar int vertex_indices"
CELLS = b"".join(b"\x01" + number.to_bytes(4, "little") if number % 2 else b"\x00" for number in range(200))

PLY = {
    "CloudCompare": ply("double f8", (*RGB, *NORMALS), before="comment Created by CloudCompare\nobj_info Generated"),
    "Open3D": ply("double f8", RGB, before="comment Created by Open3D"),
    "PCL, camera behind": ply(behind=CAMERA, data=(b"", b"\0" * 84)),
    "PCL, range grid behind": ply(before="obj_info num_cols 20", behind=GRID, data=(b"", CELLS)),
    "Stanford, range grid before": ply(before=GRID, data=(CELLS, b"")),
    "Gaussian splats": ply(more=SPLAT),
    "RealSense": ply(more=RGB, behind="element face 0\nproperty list uchar int vertex_indices"),
    "lines of Windows": ply(ending="\r\n"),
    "lines of old Macintoshes": ply(ending="\r"),
    "tabs": ply().replace(b"property float x", b"property\tfloat\tx").replace(b"ment vertex 128", b"ment  vertex 128 "),
    "keywords in capitals": ply().replace(b"ply\nformat", b"PLY\nFORMAT").replace(b"element v", b"ELEMENT V"),
    "big endian": ply(more=RGB, order=">"),
    "points": ply().replace(b"element vertex", b"element point"),
    "vertices": ply().replace(b"element vertex", b"element vertices"),
    "end_header in a comment": ply(before="comment the line end_header ends this"),
    "materials": ply(behind="element material 1\nproperty uchar red", data=(b"", b"\0")),
}
SCALED = {
    "half": (ply("half f2"), CLOUD.astype(np.float16)),
    "float16": (ply("float16 f2"), CLOUD.astype(np.float16)),
    "short": (ply("short i2", scale=1000), np.round(CLOUD * 1000)),
    "int": (ply("int32 i4", scale=10000), np.round(CLOUD * 10000)),
}


@pytest.mark.parametrize("name", PLY)
def test_ply(tmp_path, name):
    (tmp_path / "a.ply").write_bytes(PLY[name])
    np.testing.assert_allclose(read_scan(tmp_path / "a.ply"), CLOUD, atol=1e-6)


@pytest.mark.parametrize("name", SCALED)
def test_ply_of_other_numbers(tmp_path, name):
    data, points = SCALED[name]
    (tmp_path / "a.ply").write_bytes(data)
    np.testing.assert_array_equal(read_scan(tmp_path / "a.ply"), points.astype(np.float64))


def test_an_unknown_type_of_ply_is_named(tmp_path):
    (tmp_path / "a.ply").write_bytes(ply().replace(b"float x", b"string x"))
    with pytest.raises(ScanError, match="unknown type 'string'"):
        read_scan(tmp_path / "a.ply")


# ---- pcd


def pcd(fields: str, data: str, kinds: str = "", counts: str = "", **entries: str) -> str:
    """The header of a cloud."""
    names = fields.split()
    held = {
        "VERSION": ".7",
        "FIELDS": fields,
        "SIZE": " ".join(kind[1:] for kind in kinds.split()) or " ".join("4" for _ in names),
        "TYPE": " ".join(kind[0] for kind in kinds.split()) or " ".join("F" for _ in names),
        "COUNT": counts or " ".join("1" for _ in names),
        "WIDTH": str(COUNT),
        "HEIGHT": "1",
        "VIEWPOINT": "0 0 0 1 0 0 0",
        "POINTS": str(COUNT),
        "DATA": data,
        **entries,
    }
    return "# .PCD v.7 - Point Cloud Data file format\n" + "".join(f"{k} {v}\n" for k, v in held.items() if v)


TEXT = "\n".join(ROWS) + "\n"
SINGLE = CLOUD.astype("<f4").tobytes()


def records(**fields: str) -> bytes:
    found = np.zeros(COUNT, list(fields.items()))
    for column, axis in enumerate("xyz"):
        found[axis] = CLOUD[:, column]
    return found.tobytes()


PADDED = "x y z _ normal_x normal_y normal_z _ rgba curvature _"
PCD = {
    "with colour": pcd("x y z rgb", "ascii").encode() + "\n".join(f"{row} 4.2e+06" for row in ROWS).encode(),
    "lines of Windows": (pcd("x y z", "ascii") + TEXT).replace("\n", "\r\n").encode(),
    "binary, lines of Windows": pcd("x y z", "binary").replace("\n", "\r\n").encode() + SINGLE,
    "padding": pcd(PADDED, "binary", "F4 F4 F4 U1 F4 F4 F4 U1 U4 F4 U1", "1 1 1 4 1 1 1 4 1 1 8").encode()
    + records(x="<f4", y="<f4", z="<f4", a="V4", n="(3,)<f4", b="V4", c="<u4", d="<f4", e="V8"),
    "doubles": pcd("x y z", "binary", "F8 F8 F8").encode() + CLOUD.astype("<f8").tobytes(),
    "velodyne": pcd("x y z intensity ring time", "binary", "F4 F4 F4 F4 U2 F8").encode()
    + records(x="<f4", y="<f4", z="<f4", intensity="<f4", ring="<u2", time="<f8"),
    "no number of points": (pcd("x y z", "ascii", POINTS="") + TEXT).encode(),
    "version 0.5": (pcd("x y z", "ascii", VIEWPOINT="").replace("FIELDS", "COLUMNS") + TEXT).encode(),
    "lower case": pcd("x y z", "ascii").lower().encode() + TEXT.encode(),
    "fields in capitals": pcd("X Y Z", "Binary").encode() + SINGLE,
    "descriptors": pcd("x y z fpfh", "ascii", counts="1 1 1 33").encode()
    + "\n".join(row + " 0" * 33 for row in ROWS).encode(),
}


@pytest.mark.parametrize("name", PCD)
def test_pcd(tmp_path, name):
    (tmp_path / "a.pcd").write_bytes(PCD[name])
    np.testing.assert_allclose(read_scan(tmp_path / "a.pcd"), CLOUD, atol=1e-6)


def test_more_points_than_bytes_are_cut_short_before_one_is_read(tmp_path):
    (tmp_path / "a.pcd").write_text(pcd("x y z", "ascii", POINTS="1000000000") + TEXT)
    with pytest.raises(ScanError, match=r"cut short \(0 of 1000000000 points are there\)"):
        read_scan(tmp_path / "a.pcd")


# ---- numpy

WITH_COLOURS = np.concatenate([CLOUD, np.ones((COUNT, 3))], axis=1)
ARRAYS = {
    "homogeneous": WITH_COLOURS[:, :4],
    "homogeneous columns": WITH_COLOURS[:, :4].T,
    "OpenCV": CLOUD[:, None],
    "a last side of one": CLOUD[:, :, None],
    "columns with a last side of one": CLOUD.T[:, :, None],
    "two sides of one": CLOUD[None, None],
    "picture of points": WITH_COLOURS.reshape(8, 16, 6),
    "planes": CLOUD.T.reshape(3, 8, 16),
    "big endian": CLOUD.astype(">f8"),
}
NAMES = ("coord", "locs", "pts3d", "points3d", "point_map", "world_points", "xyz_world", "surface_points", "means", "p")


@pytest.mark.parametrize("name", ARRAYS)
def test_arrays(tmp_path, name):
    np.save(tmp_path / "a.npy", ARRAYS[name])
    np.testing.assert_array_equal(read_scan(tmp_path / "a.npy"), CLOUD)


@pytest.mark.parametrize("name", NAMES)
def test_the_only_positions_of_an_archive(tmp_path, name):
    colours = np.ones((COUNT, 3))
    np.savez(tmp_path / "a.npz", colors=colours, normals=colours, face_normals=colours, scale=1.0, **{name: CLOUD})
    np.testing.assert_array_equal(read_scan(tmp_path / "a.npz"), CLOUD)


@pytest.mark.parametrize("shape", [(480, 640), (192, 256), (64, 200)])
def test_pictures_of_depths_are_no_tables_of_points(tmp_path, rng, shape):
    np.save(tmp_path / "a.npy", rng.random(shape).astype(np.float32))
    with pytest.raises(ScanError, match="that of a depth picture; give it to kpred fit-depth"):
        read_scan(tmp_path / "a.npy")


# ---- content that is not what the name says


def npy() -> bytes:
    stream = io.BytesIO()
    np.save(stream, CLOUD)
    return stream.getvalue()


@pytest.mark.parametrize(
    ("name", "data", "words"),
    [
        ("a.obj", PLY["Open3D"], r"content is that of a PLY file, not of \.obj; name it \.ply"),
        ("a.ply", gzip.compress(PLY["Open3D"]), "compressed by gzip"),
        ("a.ply", b"PK\x03\x04" + bytes(90), "a ZIP archive"),
        ("a.xyz", npy(), r"NumPy array, not of \.xyz; name it \.npy"),
        ("a.glb", b"<!DOCTYPE html><html><body>404</body></html>", "a web page, not of .glb; download it again"),
        ("a.stl", b"Kaydara FBX Binary  \0", "an FBX file"),
        ("a.pcd", b"\x89PNG\r\n\x1a\n" + bytes(64), "a PNG picture"),
        ("a.npy", b"\x89HDF\r\n\x1a\n" + bytes(64), "an HDF5 file"),
        ("a.off", PLY["Open3D"], "a PLY file"),
    ],
)
def test_content_of_another_kind_is_named(tmp_path, name, data, words):
    (tmp_path / name).write_bytes(data)
    with pytest.raises(ScanError, match=re.escape(name) + ".*" + words):
        read_scan(tmp_path / name)
