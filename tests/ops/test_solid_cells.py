"""Cells that meshes fill: volumes of boxes, shells, and what two meshes share."""

import numpy as np
import pytest
import trimesh

from kpred.ops.solid_cells import shared_cells, solid_cells


def box(size: list[float], place: list[float]) -> tuple[np.ndarray, np.ndarray]:
    mesh = trimesh.creation.box(size)
    return np.asarray(mesh.vertices) + place, np.asarray(mesh.faces)


def test_the_volume_of_a_box() -> None:
    cells = solid_cells(*box([0.4, 0.6, 0.2], [0.1, -3.0, 7.0]), 0.02)
    assert len(cells) * 0.02**3 == pytest.approx(0.4 * 0.6 * 0.2, rel=0.06)


def test_bodies_of_one_mesh_are_filled_apart() -> None:
    one, other = box([0.2, 0.2, 0.2], [0, 0, 0]), box([0.2, 0.2, 0.2], [1.0, 0, 0])
    vertices, faces = np.concatenate([one[0], other[0]]), np.concatenate([one[1], other[1] + 8])
    assert len(solid_cells(vertices, faces, 0.02)) == pytest.approx(2 * 1000, rel=0.06)


def test_vertices_that_are_stored_twice_make_no_second_body() -> None:
    vertices, faces = box([0.2, 0.2, 0.2], [0.01, 0.01, 0.01])
    split, apart = vertices[faces].reshape(-1, 3), np.arange(faces.size).reshape(-1, 3)
    np.testing.assert_array_equal(solid_cells(split, apart, 0.02), solid_cells(vertices, faces, 0.02))


def test_a_bowl_is_not_filled() -> None:
    outer, inner = trimesh.creation.box([0.6, 0.6, 0.6]), trimesh.creation.box([0.5, 0.5, 0.5])
    inner.apply_translation([0, 0, 0.05])
    bowl = trimesh.util.concatenate([outer, trimesh.Trimesh(inner.vertices, inner.faces[:, ::-1])])
    bridge = np.array([[0, 8, 1]])  # One body: the hull would fill it.
    cells = solid_cells(np.asarray(bowl.vertices), np.concatenate([np.asarray(bowl.faces), bridge]), 0.02)
    assert not (np.abs((cells + 0.5) * 0.02 - [0, 0, 0.05]) < 0.1).all(axis=1).any()


def test_shared_cells_are_those_of_both() -> None:
    one, other = (
        solid_cells(*box([0.4, 0.4, 0.4], [0, 0, 0]), 0.02),
        solid_cells(*box([0.4, 0.4, 0.4], [0.2, 0, 0]), 0.02),
    )
    assert shared_cells(one, other) == pytest.approx(len(one) / 2, rel=0.02)
    assert shared_cells(one, other + [100, 0, 0]) == 0
    assert shared_cells(one, one[:0]) == 0
