import subprocess
import sys

import numpy as np
import pytest

from kpred.errors import MeshError
from kpred.shapes.mesh import Mesh, clean_mesh

SQUARE = np.array([[0, 0, 0], [2, 0, 0], [2, 3, 0], [0, 3, 0]])
HALVES = np.array([[0, 1, 2], [0, 2, 3]])


def test_area_and_bounds_of_a_rectangle():
    mesh = Mesh(SQUARE, HALVES)
    assert mesh.vertices.dtype == np.float32 and mesh.faces.dtype == np.int32
    assert mesh.area() == pytest.approx(6.0)
    np.testing.assert_array_equal(mesh.bounds, [[0, 0, 0], [2, 3, 0]])


def test_clean_drops_bad_faces_and_unused_vertices_and_keeps_parts():
    vertices = np.concatenate([[[9, 9, 9]], SQUARE, [[np.nan, 0, 0], [1, 0, 0]]])
    faces = np.array([[1, 2, 3], [1, 2, 5], [1, 1, 2], [1, 6, 2], [1, 3, 4]])
    mesh = clean_mesh(Mesh(vertices, faces, "m", np.array([7, 1, 2, 3, 8])))
    np.testing.assert_array_equal(mesh.vertices, SQUARE)
    np.testing.assert_array_equal(mesh.faces, HALVES)
    np.testing.assert_array_equal(mesh.face_parts, [7, 8])
    assert mesh.name == "m"


def test_clean_refuses_a_mesh_without_area():
    with pytest.raises(MeshError, match=r"stool.obj.*no face with an area"):
        clean_mesh(Mesh(SQUARE, np.array([[0, 1, 1]]), "stool.obj"))
    with pytest.raises(MeshError, match="no face with an area"):
        clean_mesh(Mesh(np.zeros((0, 3)), np.zeros((0, 3), int)))


@pytest.mark.parametrize(
    ("vertices", "faces", "parts", "words"),
    [
        (SQUARE[:, :2], HALVES, None, r"\(V, 3\)"),
        (SQUARE, np.array([[0, 1, 2, 3]]), None, "triangulate"),
        (SQUARE, np.array([[0, 1, 4]]), None, "does not exist"),
        (SQUARE, np.array([[0, 1, -1]]), None, "does not exist"),
        (SQUARE, HALVES, np.zeros(3), "face_parts"),
    ],
)
def test_arrays_that_are_no_mesh_are_refused(vertices, faces, parts, words):
    with pytest.raises(MeshError, match=words):
        Mesh(vertices, faces, "x", parts)


def test_the_package_needs_only_numpy_and_names_all_it_offers():
    code = (
        "import sys, kpred.shapes as s, kpred.shapes.pack, kpred.shapes.scan, kpred.shapes.source\n"
        "heavy = {'trimesh', 'torch', 'scipy', 'numba', 'sqlalchemy'} & set(sys.modules)\n"
        "assert not heavy, heavy\n"
        "assert all(getattr(s, name).__name__ == name for name in s.__all__)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
