"""Laws of sampling: uniform by area, on the surface, seeded; farthest points against a slow loop."""

import numpy as np
import pytest
import torch
from scipy.stats import chisquare, kstest

from kpred.errors import MeshError
from kpred.ops.sampling import farthest_point_sampling, sample_surface, subsample


@pytest.fixture
def mesh(rng: np.random.Generator) -> tuple[torch.Tensor, torch.Tensor]:
    """Twelve triangles of very different areas, and one of no area at all."""
    size = np.geomspace(0.1, 3.0, 12)[:, None, None]
    vertices = torch.from_numpy(rng.normal(size=(12, 3, 3)) * size).flatten(0, 1)
    faces = torch.arange(36).view(12, 3)
    return vertices, torch.cat([faces[:5], torch.tensor([[0, 1, 1]]), faces[5:]])


def _areas(vertices: torch.Tensor, faces: torch.Tensor) -> np.ndarray:
    sides = [[np.linalg.norm(vertices[f[i]] - vertices[f[i - 1]]) for i in range(3)] for f in faces.tolist()]
    half = np.sum(sides, axis=1) / 2
    return np.sqrt(np.maximum(half * np.prod(half[:, None] - np.array(sides), axis=1), 0))  # Heron


def test_faces_are_drawn_by_area(mesh, generator: torch.Generator) -> None:
    vertices, faces = mesh
    count = 40_000
    _, face = sample_surface(vertices, faces, count, generator)
    seen = np.bincount(face.numpy(), minlength=len(faces))
    areas = _areas(vertices, faces)
    assert seen[5] == 0, "a face of zero area was drawn"
    kept = areas > 1e-9
    assert chisquare(seen[kept], areas[kept] / areas[kept].sum() * count).pvalue > 1e-3
    # The strata promise more than independent draws: every face is within two of its share.
    assert np.abs(seen - areas / areas.sum() * count).max() <= 2


def test_points_lie_on_their_faces(mesh, generator: torch.Generator) -> None:
    vertices, faces = mesh
    points, face = sample_surface(vertices, faces, 500, generator)
    for point, index in zip(points, face.tolist(), strict=True):
        corners = vertices[faces[index]]
        system = torch.cat([corners.T, torch.ones(1, 3, dtype=corners.dtype)])
        weights = torch.linalg.lstsq(system, torch.cat([point, point.new_ones(1)])[:, None]).solution[:, 0]
        assert weights.min() > -1e-9
        assert torch.dist(weights @ corners, point) < 1e-9


def test_points_are_uniform_within_a_face(generator: torch.Generator) -> None:
    vertices = torch.tensor([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype=torch.float64)
    points, _ = sample_surface(vertices, torch.tensor([[0, 1, 2]]), 5000, generator)
    # The height x over a right triangle has the distribution 1 - (1 - x)^2.
    for axis in range(2):
        assert kstest(points[:, axis].numpy(), lambda x: 1 - (1 - x) ** 2).pvalue > 1e-3


def test_same_generator_state_gives_the_same_points(mesh) -> None:
    draws = [sample_surface(*mesh, 64, torch.Generator().manual_seed(s))[0] for s in (3, 3, 4)]
    assert torch.equal(draws[0], draws[1])
    assert not torch.equal(draws[0], draws[2])


@pytest.mark.parametrize("faces", [torch.zeros(0, 3, dtype=torch.long), torch.tensor([[0, 1, 1], [0, 1, 2]])])
def test_a_mesh_without_area_is_refused(faces: torch.Tensor) -> None:
    vertices = torch.tensor([[0.0, 0, 0], [1, 1, 1], [2, 2, 2]])
    with pytest.raises(MeshError, match="non-zero area"):
        sample_surface(vertices, faces, 10)


def _slow_farthest(points: np.ndarray, count: int) -> list[int]:
    centroid = points.mean(0)
    chosen = [int(np.argmax([((p - centroid) ** 2).sum() for p in points]))]
    while len(chosen) < count:
        gap = [min(((p - points[c]) ** 2).sum() for c in chosen) for p in points]
        chosen.append(int(np.argmax(gap)))
    return chosen


def test_farthest_points_against_a_slow_loop(rng: np.random.Generator) -> None:
    points = rng.normal(size=(3, 60, 3))
    found = farthest_point_sampling(torch.from_numpy(points), 15)
    assert found.tolist() == [_slow_farthest(cloud, 15) for cloud in points]


def test_farthest_points_are_spread(rng: np.random.Generator) -> None:
    points = torch.from_numpy(rng.normal(size=(2, 300, 3)))
    index = farthest_point_sampling(points, 20)
    for cloud, rows in zip(points, index, strict=True):
        chosen = cloud[rows]
        apart = torch.pdist(chosen).min()
        covering = torch.cdist(cloud, chosen).amin(1).max()
        # Any two chosen points are farther apart than any point is from the chosen ones.
        assert apart >= covering - 1e-12
        assert len(set(rows.tolist())) == 20


def test_farthest_points_do_not_depend_on_order(rng: np.random.Generator) -> None:
    points = torch.from_numpy(rng.normal(size=(1, 100, 3)))
    order = torch.from_numpy(rng.permutation(100))
    first = points[0, farthest_point_sampling(points, 12)[0]]
    second = points[:, order][0, farthest_point_sampling(points[:, order], 12)[0]]
    assert torch.equal(first, second)


def test_points_at_even_steps(generator: torch.Generator) -> None:
    points = torch.rand(2, 100, 3, generator=generator)
    assert torch.equal(subsample(points, 25), points[:, ::4])
    assert torch.equal(subsample(points[0], 30), points[0, ::3])
    assert subsample(points, 101) is points
    assert subsample(points, None) is points
