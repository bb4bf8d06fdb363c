"""Points of a model are carried by the faces of its mesh that they lie on."""

from dataclasses import replace

import numpy as np
import pytest
import torch
import trimesh

import kpred
from kpred.errors import DatabaseError
from kpred.fitting import bundled_database_path
from kpred.fitting.surface_points import closest_faces, surface_points
from kpred.ops.lattice import lattice_weights


@pytest.fixture(scope="module")
def database() -> kpred.Database:
    return kpred.Database.open(bundled_database_path(), read_only=True)


def test_the_closest_face_is_that_of_a_slow_reference(rng: np.random.Generator) -> None:
    vertices = rng.uniform(-1, 1, (40, 3)).astype(np.float32)
    faces = rng.integers(0, 40, (60, 3)).astype(np.int32)
    faces[:2] = [[3, 3, 3], [4, 5, 5]]  # without area
    points = rng.uniform(-1.5, 1.5, (200, 3)).astype(np.float32)
    face, shares = closest_faces(points, vertices, faces)
    place = (vertices[faces[face]] * shares[..., None]).sum(1)
    proper = vertices[faces[2:]].astype(np.float64)
    for point, found in zip(points.astype(np.float64), place, strict=True):
        nearest = trimesh.triangles.closest_point(proper, np.tile(point, (len(proper), 1)))
        least = np.linalg.norm(nearest - point, axis=1).min()
        assert np.linalg.norm(found - point) <= least + 1e-5
    assert np.allclose(shares.sum(1), 1, atol=1e-5)
    assert (shares >= -1e-6).all()


def test_a_models_points_lie_on_its_mesh_and_move_with_it(database: kpred.Database) -> None:
    name = database.model_ids("chair")[0]
    points = torch.from_numpy(database.candidates("chair", [name]).points[0])
    surface = surface_points(database, name, points)
    assert surface.corners is not None and surface.shares is not None
    place = (surface.vertices[surface.corners] * surface.shares[..., None]).sum(1)
    assert torch.allclose(place, points, atol=2e-4)
    assert surface_points(database, name, points) is surface


def test_a_lattice_carries_points_as_it_does_the_corners_of_their_faces(database: kpred.Database) -> None:
    name = database.model_ids("table")[1]
    points = torch.from_numpy(database.candidates("table", [name]).points[0])
    surface = surface_points(database, name, points)
    assert surface.corners is not None and surface.shares is not None
    half = torch.maximum(surface.vertices.abs().amax(0), points.abs().amax(0))
    columns = surface.lattice_columns(points, half)
    at_vertices = lattice_weights(surface.vertices, -half, half)
    expected = (surface.shares[..., None] * at_vertices[surface.corners]).sum(1)
    assert torch.allclose(columns, expected, atol=1e-5)
    assert torch.allclose(columns.sum(1), torch.ones(len(points)), atol=1e-4)
    free = replace(surface, corners=None, shares=None)
    assert torch.equal(free.lattice_columns(points, half), lattice_weights(points, -half, half))


def test_points_of_a_model_that_is_not_there(database: kpred.Database) -> None:
    with pytest.raises(DatabaseError, match="no-such-chair"):
        surface_points(database, "no-such-chair", torch.rand(10, 3))
