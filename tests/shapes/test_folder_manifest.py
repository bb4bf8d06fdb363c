"""A folder's manifest: ids, axes, sizes and details of its meshes."""

import json

import numpy as np
import pytest

from kpred.errors import ManifestError
from kpred.shapes.manifest import read_manifest
from kpred.shapes.source import open_shapes
from kpred.shapes.upright_mesh import axis_rotation

BOX = "v 0 0 0\nv 1 0 0\nv 0 2 0\nv 0 0 4\nf 1 2 3\nf 1 2 4\nf 1 3 4\n"


def write(folder, rows, header="path,id,category,up,front,width,height,depth,author,license,shelf mark"):
    (folder / "a.obj").write_text(BOX)
    (folder / "manifest.csv").write_text("\n".join([header, *rows]) + "\n")
    return folder


def opened(folder):
    told = []
    return list(open_shapes(folder, report=told.append)), told


def test_ids_and_details_come_from_the_manifest_of_a_folder(tmp_path):
    shapes, told = opened(write(tmp_path, ["a.obj,chair/a,chair,,,,,,Ann Lee,CC0-1.0,7"]))
    assert not told
    (shape,) = shapes
    assert (shape.model_id, shape.category, shape.split) == ("chair/a", "chair", "source")
    assert shape.details == {"author": "Ann Lee", "licence": "CC0-1.0", "shelf mark": "7"}
    np.testing.assert_array_equal(shape.mesh.vertices[3], [0, 0, 4])


def test_json_says_the_same_as_csv(tmp_path):
    write(tmp_path, ["a.obj,chair/a,chair,z,-y,,,,Ann,CC0,"])
    from_csv = list(read_manifest(tmp_path / "manifest.csv"))
    row = {"path": "a.obj", "id": "chair/a", "category": "chair", "up": "z", "front": "-y", "author": "Ann"}
    (tmp_path / "other.json").write_text(json.dumps([row | {"licence": "CC0", "width": None}]))
    assert list(read_manifest(tmp_path / "other.json")) == from_csv


@pytest.mark.parametrize("up", ["x", "y", "z", "-x", "-y", "-z"])
@pytest.mark.parametrize("front", ["x", "y", "z", "-x", "-y", "-z"])
def test_up_becomes_y_and_front_z(tmp_path, up, front):
    axes = {"x": [1, 0, 0], "y": [0, 1, 0], "z": [0, 0, 1]}
    axes |= {f"-{name}": [-number for number in axis] for name, axis in axes.items()}
    shapes, told = opened(write(tmp_path, [f"a.obj,a,chair,{up},{front},,,,,,"]))
    if up[-1] == front[-1]:
        assert not shapes
        assert "one axis" in told[0]
        return
    rotation = axis_rotation(up, front)
    np.testing.assert_array_equal(rotation @ axes[up], [0, 1, 0])
    np.testing.assert_array_equal(rotation @ axes[front], [0, 0, 1])
    assert np.linalg.det(rotation) == pytest.approx(1)
    np.testing.assert_allclose(
        shapes[0].mesh.vertices, np.array([[0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 4]]) @ rotation.T
    )


def test_a_size_in_metres_gives_the_unit(tmp_path):
    shapes, told = opened(write(tmp_path, ["a.obj,a,chair,,,0.0254,0.0508,0.1016,,,"]))
    assert not told
    np.testing.assert_allclose(np.ptp(shapes[0].mesh.vertices, axis=0), [0.0254, 0.0508, 0.1016], rtol=1e-5)


def test_a_size_that_is_true_keeps_the_numbers_to_the_bit(tmp_path):
    shapes, _ = opened(write(tmp_path, ["a.obj,a,chair,,,1.01,1.99,4.0,,,"]))
    np.testing.assert_array_equal(shapes[0].mesh.vertices[3], [0, 0, 4])


@pytest.mark.parametrize(
    ("row", "why"),
    [
        ("a.obj,a,chair,,,2,1,4,,,", "in any unit"),
        ("a.obj,a,chair,up,,,,,,,", "its up is 'up'"),
        ("a.obj,a,chair,,,wide,1,4,,,", "not a length"),
        ("a.obj,a,chair,,,-1,2,4,,,", "not a length"),
        (",a,chair,,,,,,,,", "names no file"),
        ("b.obj,a,chair,,,,,,,,", "b.obj"),
    ],
)
def test_broken_rows_are_left_out_with_a_reason(tmp_path, row, why):
    shapes, told = opened(write(tmp_path, [row, "a.obj,good,chair,,,,,,,,"]))
    assert [shape.model_id for shape in shapes] == ["good"]
    assert why in told[0]


@pytest.mark.parametrize("content", ["", "a,b\n1,2\n", "\0\0\0", '{"path": 1}'])
def test_what_is_no_manifest_is_refused(tmp_path, content):
    for name in ("manifest.csv", "manifest.json"):
        file = tmp_path / name
        file.write_text(content)
        with pytest.raises(ManifestError, match=name):
            list(read_manifest(file))
