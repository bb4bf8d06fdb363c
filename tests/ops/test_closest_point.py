"""Distances to a mesh are those of a slow reference."""

import numpy as np
import pytest
import trimesh

from kpred.ops.closest_point import closest_points


def test_the_closest_point_is_that_of_a_slow_reference(rng: np.random.Generator) -> None:
    vertices = rng.uniform(-1, 1, (40, 3)).astype(np.float32)
    faces = rng.integers(0, 40, (60, 3)).astype(np.int32)
    faces[:2] = [[3, 3, 3], [4, 5, 5]]  # without area
    points = rng.uniform(-1.5, 1.5, (200, 3)).astype(np.float32)
    distance, face = closest_points(points, vertices, faces)
    proper = vertices[faces[2:]].astype(np.float64)
    for point, found, row in zip(points.astype(np.float64), distance, face, strict=True):
        nearest = trimesh.triangles.closest_point(proper, np.tile(point, (len(proper), 1)))
        assert found == pytest.approx(np.linalg.norm(nearest - point, axis=1).min(), abs=1e-5)
        own = trimesh.triangles.closest_point(vertices[faces[[row]]].astype(np.float64), point[None])
        assert row < 2 or np.linalg.norm(own - point) == pytest.approx(found, abs=1e-5)


def test_points_of_the_surface_have_no_distance(rng: np.random.Generator) -> None:
    box = trimesh.creation.box((1.0, 2.0, 3.0))
    points = trimesh.sample.sample_surface(box, 300, seed=1)[0]
    distance, _ = closest_points(points, box.vertices, box.faces)
    assert distance.max() < 1e-9
    outside, _ = closest_points(np.array([[0.0, 0.0, 2.5]]), box.vertices, box.faces)
    assert outside[0] == pytest.approx(1.0)
