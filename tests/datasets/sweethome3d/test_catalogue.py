import csv
from pathlib import Path

import numpy as np
import pytest

from kpred.datasets.sweethome3d.catalogue import make_catalogue
from kpred.errors import MeshError, OutputError
from kpred.shapes import read_mesh


def manifest(folder: Path) -> dict[str, dict[str, str]]:
    with open(folder / "manifest.csv", encoding="utf-8", newline="") as stream:
        return {row["id"]: row for row in csv.DictReader(stream)}


def test_models_stand_on_the_floor_in_metres_with_materials_beside_them(write_library, tmp_path):
    library = write_library(tmp_path / "a.sh3f", {"one": {}})
    make_catalogue([library], tmp_path / "out")
    row = manifest(tmp_path / "out")["chair/test-one"]
    mesh = read_mesh(tmp_path / "out" / row["path"])
    np.testing.assert_allclose(mesh.bounds, [[-0.2, 0, -0.05], [0.2, 0.8, 0.05]], atol=1e-6)
    assert [row[key] for key in ("width", "height", "depth", "author")] == ["0.4", "0.8", "0.1", "Ann"]
    folder = (tmp_path / "out" / row["path"]).parent
    assert {file.name for file in folder.iterdir()} == {"test-one.obj", "thing.mtl", "oak.png"}
    assert (tmp_path / "out/licences/test.txt").read_text() == "the licence"


def test_rotation_of_the_library_turns_the_model_before_it_is_measured(write_library, tmp_path):
    facts = {"modelRotation": "0 0 1 0 1 0 -1 0 0", "width": "10", "depth": "40"}
    library = write_library(tmp_path / "a.sh3f", {"one": facts})
    make_catalogue([library], tmp_path / "out")
    mesh = read_mesh(tmp_path / "out/chair/test-one/test-one.obj")
    # The corner that was at z = 5 of 5, above x = 0, is now at x = +, z = +.
    corner = mesh.vertices[np.argmax(mesh.vertices @ [1, 1, 1])]
    np.testing.assert_allclose(corner, [0.05, 0.8, 0.2], atol=1e-6)


def test_everything_but_coordinates_stays_as_it_was(write_library, tmp_path):
    library = write_library(tmp_path / "a.sh3f", {"one": {}})
    make_catalogue([library], tmp_path / "out")
    text = (tmp_path / "out/chair/test-one/test-one.obj").read_text()
    rest = [line for line in text.splitlines() if not line.startswith(("v ", "vn "))]
    assert rest == [
        *("mtllib thing.mtl", "o body", "usemtl wood", "vt 0 0", "vt 1 0", "vt 1 1"),
        *("f 1/1/1 2/2/1 3/3/1", "f 1/1/1 3/3/1 4/1/1"),
    ]


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("Released under\nCreative Commons Zero (Public Domain)\n", "CC0-1.0"),
        ('<h3>Released under <a href="x">Creative Commons Attribution 3.0</a></h3>', "CC-BY-3.0"),
    ],
)
def test_a_models_own_licence_counts_before_the_librarys(write_library, tmp_path, text, name):
    library = write_library(tmp_path / "a.sh3f", {"one": {"LICENSE": text}}, "all rights reserved")
    make_catalogue([library], tmp_path / "out")
    assert manifest(tmp_path / "out")["chair/test-one"]["licence"] == name


@pytest.mark.parametrize(
    "licence", ["Creative Commons Attribution-NonCommercial 3.0", "Attribution-ShareAlike 4.0", "all rights reserved"]
)
def test_what_may_not_be_passed_on_is_left_out_and_listed(write_library, tmp_path, licence):
    models = {"free": {}, "bound": {"LICENSE": f"Released under\n{licence}\n"}}
    report = make_catalogue([write_library(tmp_path / "a.sh3f", models)], tmp_path / "out")
    assert list(manifest(tmp_path / "out")) == ["chair/test-free"]
    assert [one.key for one in report.left_out] == ["Test#bound"]
    assert "licence" in report.left_out[0].reason


@pytest.mark.parametrize(
    ("title", "category"),
    [
        *(("Bar stool", "chair"), ("Glass table", "table"), ("Bedside table", "cabinet"), ("Wardrobe", "cabinet")),
        *(("Desk lamp", "lamp"), ("Table tennis bat", "miscellaneous"), ("Wheelchair", "wheelchair")),
        *(("Piano bench", "bench"), ("Something", "office")),
    ],
)
def test_titles_tell_categories(write_library, tmp_path, title, category):
    make_catalogue([write_library(tmp_path / "a.sh3f", {"one": {"name": title}})], tmp_path / "out")
    assert list(manifest(tmp_path / "out")) == [f"{category}/test-one"]


def test_the_same_libraries_give_the_same_bytes(write_library, tmp_path):
    library = write_library(tmp_path / "a.sh3f", {"one": {}, "two": {"name": "Table"}})
    for name in ("a", "b"):
        make_catalogue([library], tmp_path / name)
    files = [sorted(path for path in (tmp_path / name).rglob("*") if path.is_file()) for name in ("a", "b")]
    assert [file.read_bytes() for file in files[0]] == [file.read_bytes() for file in files[1]]
    assert len(files[0]) == 8


def test_damaged_models_are_left_out_and_damaged_libraries_refused(write_library, tmp_path):
    bad = {"OBJ": "v 0 0 zero\nf 1 1 1\n"}
    report = make_catalogue([write_library(tmp_path / "a.sh3f", {"one": bad, "two": {}})], tmp_path / "out")
    assert list(manifest(tmp_path / "out")) == ["chair/test-two"]
    assert report.left_out[0].key == "Test#one"
    (tmp_path / "b.sh3f").write_bytes(b"PK no archive")
    with pytest.raises(MeshError, match="b.sh3f"):
        make_catalogue([tmp_path / "b.sh3f"], tmp_path / "out2")
    with pytest.raises(MeshError, match="size"):
        make_catalogue([write_library(tmp_path / "c.sh3f", {"one": {"width": "-1"}})], tmp_path / "out3")


def test_a_folder_of_something_else_is_not_written_into(write_library, tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "thesis.txt").write_text("x")
    with pytest.raises(OutputError, match="no catalogue"):
        make_catalogue([write_library(tmp_path / "a.sh3f", {"one": {}})], tmp_path / "out")


def test_vertices_that_no_face_uses_do_not_count_in_the_size(write_library, tmp_path):
    obj = "v 0 0 0\nv 10 0 0\nv 10 20 0\nv 0 20 5\nv 0 0 900\nf 1 2 3\nf -5 -3 -2\n"
    make_catalogue([write_library(tmp_path / "a.sh3f", {"one": {"OBJ": obj}})], tmp_path / "out")
    mesh = read_mesh(tmp_path / "out/chair/test-one/test-one.obj")
    np.testing.assert_allclose(mesh.bounds, [[-0.2, 0, -0.05], [0.2, 0.8, 0.05]], atol=1e-6)
