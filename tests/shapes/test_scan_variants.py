"""The same cloud in the many ways that programs write it: every file gives the same points, or is refused."""

import warnings

import numpy as np
import pytest

from kpred.errors import ScanError
from kpred.shapes.scan import ScanWarning, read_scan


@pytest.fixture
def cloud(rng) -> np.ndarray:
    return rng.normal(size=(300, 3)).round(4)


def rows(cloud: np.ndarray, separator: str, before: str = "", after: str = "", quote: str = "") -> str:
    lines = []
    for number, row in enumerate(cloud.tolist()):
        words = [f"{quote}{value:.4f}{quote}" for value in row]
        lines.append(separator.join(([before.format(number)] if before else []) + words + ([after] if after else [])))
    return "\n".join(lines) + "\n"


def text_of(cloud: np.ndarray, layout: str) -> str:
    comma = rows(cloud, "\t").replace(".", ",")
    semicolons = rows(cloud, ";").replace(".", ",")
    return {
        "decimal commas and tabs": comma,
        "decimal commas and blanks": comma.replace("\t", "  "),
        "decimal commas and semicolons": semicolons,
        "quoted decimal commas": rows(cloud, ",", quote='"').replace(".", ",").replace('","', '";"'),
        "quoted": '"x","y","z"\n' + rows(cloud, ",", quote='"'),
        "quoted, commas within": rows(cloud, ";", quote='"').replace(".", ","),
        "ParaView": '"Normals:0","Normals:1","Normals:2","Points:0","Points:1","Points:2"\n'
        + rows(cloud, ",", before="0.1,0.2,0.3"),
        "surveyor": "ID;Easting;Northing;Height\n" + rows(cloud, ";", before="{}"),
        "surveyor in German": "Punkt;Rechtswert [m];Hochwert [m];Höhe [m]\n" + rows(cloud, ";", before="P{}"),
        "heights": "Y;X;H\n" + rows(cloud[:, [1, 0, 2]], ";"),
        "units": "X [mm], Y [mm], Z [mm], I\n" + rows(cloud, ", ", after="7"),
        "pos": "time pos_x pos_y pos_z\n" + rows(cloud, " ", before="{}.5"),
        "coordinates": "X Coordinate\tY Coordinate\tZ Coordinate\n" + rows(cloud, "\t"),
        "name first": rows(cloud, " ", before="P{}"),
        "running number first": rows(cloud, " ", before="{}", after="255"),
        "two blocks": "150\n" + rows(cloud[:150], " ", after="-1023 1 2 3") + "150\n" + rows(cloud[150:], " "),
        "title": "Scan of a chair\n\n" + rows(cloud, " "),
        "colour words": rows(cloud, ",", after="red"),
    }[layout]


LAYOUTS = [
    "decimal commas and tabs",
    "decimal commas and blanks",
    "decimal commas and semicolons",
    "quoted decimal commas",
    "quoted",
    "quoted, commas within",
    "ParaView",
    "surveyor",
    "surveyor in German",
    "heights",
    "units",
    "pos",
    "coordinates",
    "name first",
    "running number first",
    "two blocks",
    "title",
    "colour words",
]


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
@pytest.mark.parametrize("ending", ["\n", "\r\n", "\r"])
def test_text(tmp_path, cloud, layout, encoding, ending):
    (tmp_path / "a.txt").write_bytes(text_of(cloud, layout).replace("\n", ending).encode(encoding))
    np.testing.assert_array_equal(read_scan(tmp_path / "a.txt"), cloud)


@pytest.mark.parametrize("first", ["0;0;0\n", "1;2;3\n"])
def test_decimal_commas_behind_whole_numbers(tmp_path, cloud, first):
    (tmp_path / "a.asc").write_text(first + rows(cloud, ";").replace(".", ","))
    np.testing.assert_array_equal(read_scan(tmp_path / "a.asc")[1:], cloud)


@pytest.mark.parametrize("names", ["nx,ny,nz,red", "a,b,c,d", "lat,lon,alt,time", "Normals:0,Normals:1,Normals:2,area"])
def test_columns_of_other_names_are_refused(tmp_path, cloud, names):
    (tmp_path / "a.csv").write_text(names + "\n" + rows(cloud, ",", after="1.0"))
    with pytest.raises(ScanError, match=r"a\.csv: its columns are named .*; name those of the coordinates x, y and z"):
        read_scan(tmp_path / "a.csv")


def test_whole_x_that_only_looks_like_a_number_of_the_row_stays(tmp_path, rng):
    grid = np.array([[x, y, z, 9.5] for y in range(8) for x in range(8) for z in (0, 3)], dtype=float)
    (tmp_path / "a.xyz").write_text("\n".join(" ".join(map(str, row)) for row in grid.tolist()))
    np.testing.assert_array_equal(read_scan(tmp_path / "a.xyz"), grid[:, :3])


# ---- numpy


def test_arrays_of_other_layouts(tmp_path, cloud):
    colours = np.full((300, 3), 7.0)
    records = np.zeros(300, [("intensity", "f4"), ("X", "f8"), ("Y", "f8"), ("Z", "f8")])
    for column, axis in enumerate("XYZ"):
        records[axis] = cloud[:, column]
    packed = np.zeros(300, [("xyz", "f8", 3), ("rgb", "u1", 3)])
    packed["xyz"] = cloud
    arrays = [
        cloud.T,
        np.concatenate([cloud, colours], axis=1).T,
        np.asfortranarray(cloud.T),
        cloud.reshape(20, 15, 3),
        np.concatenate([cloud, colours], axis=1).reshape(20, 15, 6),
        cloud[None],
        cloud.T.reshape(3, 20, 15),
        records,
        packed,
    ]
    for array in arrays:
        np.save(tmp_path / "a.npy", array)
        np.testing.assert_array_equal(read_scan(tmp_path / "a.npy"), cloud, err_msg=str((array.shape, array.dtype)))
        np.savez_compressed(tmp_path / "a.npz", array, labels=np.zeros(300))
        np.testing.assert_array_equal(read_scan(tmp_path / "a.npz"), cloud)


def test_pictures_and_foreign_records_are_no_clouds(tmp_path):
    for array, words in (
        (np.zeros((40, 30, 3), np.uint8), "it is a picture"),
        (np.zeros(300, [("a", "f4"), ("b", "f4")]), "its fields are a, b"),
        (np.zeros((300, 2)), r"its shape is \(300, 2\)"),
        (np.zeros((2, 300)), r"its shape is \(2, 300\)"),
    ):
        np.save(tmp_path / "a.npy", array)
        with pytest.raises(ScanError, match=words):
            read_scan(tmp_path / "a.npy")


# ---- precision


def test_single_precision_far_from_the_origin_is_reported(tmp_path, cloud):
    far = cloud + [694386.2, 5155487.5, 381.0]
    np.save(tmp_path / "double.npy", far)
    np.save(tmp_path / "single.npy", far.astype(np.float32))
    np.save(tmp_path / "near.npy", (cloud + 1000).astype(np.float32))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        read_scan(tmp_path / "double.npy")
        read_scan(tmp_path / "near.npy")
    with pytest.warns(ScanWarning, match=r"single\.npy: its points are stored in single precision, 0\.5 apart"):
        read_scan(tmp_path / "single.npy")


# ---- what is no file


def test_pipes_and_folders_are_refused_at_once(tmp_path):
    import os

    os.mkfifo(tmp_path / "a.ply")
    with pytest.raises(ScanError, match=r"a\.ply: it is a pipe or a device"):
        read_scan(tmp_path / "a.ply")
    with pytest.raises(ScanError, match="it cannot be read"):
        read_scan(tmp_path / ("a" * 5000 + ".ply"))


def test_rasters_of_heights_are_no_points(tmp_path):
    rows = "\n".join(" ".join(["1.5"] * 9) for _ in range(9))
    (tmp_path / "a.asc").write_text(f"ncols 9\nnrows 9\nxllcorner 0\nyllcorner 0\ncellsize 1\n{rows}\n")
    with pytest.raises(ScanError, match="raster of heights"):
        read_scan(tmp_path / "a.asc")


# ---- what single programs write, beyond the layouts above


def numbered(cloud: np.ndarray, before: str, after: str = "") -> str:
    return rows(cloud, " ", before=before, after=after)


def grid_numbers(cloud: np.ndarray) -> str:
    """Row and column of the scanner before each point, its colour behind (FARO)."""
    lines = rows(cloud, " ").splitlines()
    return "".join(f"{i // 20} {i % 20} {line} 90 80 70\n" for i, line in enumerate(lines))


PROGRAMS = {
    "Agisoft": lambda c: "#Label,X/Easting,Y/Northing,Z/Altitude\n" + rows(c, ",", before="point {}", after="0.005"),
    "CloudCompare": lambda c: "300\n//X Y Z Nx Ny Nz\n" + rows(c, " ", after="0.1 0.2 0.3"),
    "Fortran": lambda c: "".join(" ".join(f"{x:.6E}" for x in row) + "\n" for row in c.tolist()).replace("E", "D"),
    "Leica": lambda c: "300\n" + rows(c, " ", after="-1023 1 2 3"),
    "Python tuples": lambda c: "".join(f"{tuple(row)}\n" for row in c.tolist()),
    "Python lists": lambda c: "".join(f"{row}\n" for row in c.tolist()),
    "camel case": lambda c: "cartesianX,cartesianY,cartesianZ,intensity\n" + rows(c, ",", after="0.5"),
    "centres": lambda c: "label,center_x,center_y,center_z\n" + rows(c, ",", before="a"),
    "decimal commas and commas": lambda c: rows(c, "; ").replace(".", ",").replace(";", ","),
    "pandas": lambda c: ",0,1,2\n" + rows(c, ",", before="{}"),
    "pandas without its index": lambda c: "0,1,2\n" + rows(c, ","),
    "running numbers from 1000": lambda c: "".join(f"{1000 + i} {x} {y} {z}\n" for i, (x, y, z) in enumerate(c)),
    "numbers with gaps": lambda c: "".join(f"{7 + 3 * i} {x} {y} {z}\n" for i, (x, y, z) in enumerate(c)),
    "rows and columns": grid_numbers,
    "title of three words": lambda c: "Scan of chair\nDate: today\n" + rows(c, " "),
    "NaN of Microsoft": lambda c: rows(c, " ") + "1.#QNAN 1.#QNAN 1.#QNAN\n-1.#IND 0 0\n",
    "empty rows of a table": lambda c: "x,y,z\n" + rows(c, ",") + ",,\n,,\n",
    "end of file of DOS": lambda c: rows(c, " ") + "\x1a",
    "zeros to a whole block": lambda c: rows(c, " ") + "\0\0\0\0",
}


@pytest.mark.parametrize("program", PROGRAMS)
def test_text_of_single_programs(tmp_path, cloud, program):
    (tmp_path / "a.csv").write_text(PROGRAMS[program](cloud))
    np.testing.assert_array_equal(read_scan(tmp_path / "a.csv"), cloud)


def test_names_of_columns_in_latin_1(tmp_path, cloud):
    (tmp_path / "a.csv").write_text("Nr;Rechtswert;Hochwert;Höhe\n" + rows(cloud, ";", before="{}"), encoding="latin-1")
    np.testing.assert_array_equal(read_scan(tmp_path / "a.csv"), cloud)


def test_a_profile_with_whole_growing_x_keeps_it(tmp_path, rng):
    profiles = np.array([[x, y / 8, round(rng.random(), 4), 0.5] for y in range(4) for x in range(80)])
    (tmp_path / "a.xyz").write_text("\n".join(f"{int(x)} {y} {z} {i}" for x, y, z, i in profiles))
    np.testing.assert_array_equal(read_scan(tmp_path / "a.xyz"), profiles[:, :3])


@pytest.mark.parametrize("names", [("x", "y", "z"), ("pcd",), ("data",), ("verts",)])
def test_names_of_arrays(tmp_path, cloud, names):
    arrays = dict(zip(names, cloud.T if len(names) == 3 else [cloud], strict=True))
    np.savez(tmp_path / "a.npz", **arrays, colors=np.zeros((300, 3), np.uint8))
    np.testing.assert_array_equal(read_scan(tmp_path / "a.npz"), cloud)


def test_arrays_of_unknown_names_and_unequal_axes_are_refused(tmp_path, cloud):
    for arrays, words in (
        ({"a": cloud, "b": cloud}, "none of its arrays is named points"),
        ({"x": cloud[:, 0], "y": cloud[:, 1], "z": cloud[:99, 2]}, "x, y and z differ in length"),
    ):
        np.savez(tmp_path / "a.npz", **arrays)
        with pytest.raises(ScanError, match=words):
            read_scan(tmp_path / "a.npz")


def test_a_batch_of_one_cloud_by_columns(tmp_path, cloud):
    np.save(tmp_path / "a.npy", np.ascontiguousarray(cloud.T[None]))
    np.testing.assert_array_equal(read_scan(tmp_path / "a.npy"), cloud)


def test_pointers_of_git_lfs_are_named(tmp_path):
    (tmp_path / "a.ply").write_text("version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n")
    with pytest.raises(ScanError, match="pointer of Git LFS"):
        read_scan(tmp_path / "a.ply")
