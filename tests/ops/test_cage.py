"""Cages: the icosphere is a closed sphere, the enclosing cage encloses, the pulled cage keeps its clearance."""

import itertools

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from kpred.ops.cage import CLEARANCE, PULL_RATE, enclosing_cage, icosphere, pulled_in_cage


def winding_numbers(points: np.ndarray, vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """1 inside a closed outward mesh, 0 outside: solid angles of all faces (Van Oosterom and Strackee 1983)."""
    a, b, c = (vertices[faces[:, i]][None] - points[:, None] for i in range(3))
    na, nb, nc = (np.linalg.norm(x, axis=-1) for x in (a, b, c))
    up = np.einsum("nfi,nfi->nf", a, np.cross(b, c))
    dot = {k: np.einsum("nfi,nfi->nf", x, y) for k, x, y in (("ab", a, b), ("bc", b, c), ("ca", c, a))}
    down = na * nb * nc + dot["ab"] * nc + dot["bc"] * na + dot["ca"] * nb
    return (2 * np.arctan2(up, down)).sum(1) / (4 * np.pi)


def _share_inside(points: torch.Tensor, cage: torch.Tensor, subdivisions: int = 1) -> float:
    faces = icosphere(subdivisions)[1].numpy()
    return float((winding_numbers(points.double().numpy(), cage.double().numpy(), faces) > 0.5).mean())


def _corners() -> torch.Tensor:
    return torch.tensor(list(itertools.product((-1.0, 1.0), repeat=3)))


@pytest.mark.parametrize(("subdivisions", "count", "triangles"), [(0, 12, 20), (1, 42, 80), (2, 162, 320)])
def test_icosphere_is_a_closed_outward_unit_sphere(subdivisions: int, count: int, triangles: int) -> None:
    vertices, faces = icosphere(subdivisions)
    assert vertices.shape == (count, 3)
    assert faces.shape == (triangles, 3)
    torch.testing.assert_close(vertices.norm(dim=1), torch.ones(count))
    directed = [(int(f[i]), int(f[(i + 1) % 3])) for f in faces for i in range(3)]
    assert len(set(directed)) == len(directed), "two faces run along one edge in the same sense"
    assert {(b, a) for a, b in directed} == set(directed), "an edge has one face only"
    assert count - len(directed) // 2 + triangles == 2  # Euler
    corners = vertices[faces]
    normal = torch.linalg.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert ((normal * corners.mean(1)).sum(1) > 0).all()
    assert torch.pdist(vertices).min() > 0.1


def test_winding_numbers_know_inside_from_outside() -> None:
    vertices, faces = icosphere(1)
    points = np.array([[0.0, 0, 0], [0.9, 0, 0], [1.01, 0, 0], [0, 5, 0]])
    np.testing.assert_allclose(
        winding_numbers(points, vertices.double().numpy(), faces.numpy()), [1, 1, 0, 0], atol=1e-9
    )


@given(
    seed=st.integers(0, 99_999),
    n=st.integers(1, 80),
    thin=st.tuples(*[st.sampled_from([0.0, 0.02, 0.3, 1.0])] * 3),
    subdivisions=st.integers(0, 2),
    margin=st.sampled_from([0.0, 0.1, 0.3]),
)
def test_enclosing_cage_encloses_every_point(seed, n, thin, subdivisions, margin) -> None:
    generator = torch.Generator().manual_seed(seed)
    points = (2 * torch.rand(2, n, 3, generator=generator) - 1) * torch.tensor(thin)
    points[0, 0] = 1.0  # a corner of the unit box
    cages = enclosing_cage(points, margin=margin, subdivisions=subdivisions)
    for cloud, cage in zip(points, cages, strict=True):
        # Pushed out by the margin they are still inside: the promised distance along the ray from the origin.
        pushed = cloud / (1 - margin) * (1 - 1e-4)
        assert _share_inside(pushed, cage, subdivisions) == 1.0


def test_a_box_is_cut_by_the_pulled_cage_and_held_by_the_enclosing_one(generator: torch.Generator) -> None:
    """Box corners: the flaw of the published cage that the enclosing one mends."""
    points = torch.cat([_corners(), 2 * torch.rand(400, 3, generator=generator) - 1])[None]
    assert _share_inside(_corners(), pulled_in_cage(points)[0]) < 1
    assert _share_inside(_corners(), enclosing_cage(points)[0]) == 1
    assert _share_inside(points[0], enclosing_cage(points)[0]) == 1


def test_cage_vertices_stay_on_their_rays(generator: torch.Generator) -> None:
    points = 2 * torch.rand(2, 100, 3, generator=generator) - 1
    directions, _ = icosphere(1)
    for cage in (*pulled_in_cage(points), *enclosing_cage(points)):
        torch.testing.assert_close(torch.nn.functional.normalize(cage, dim=1), directions, rtol=0, atol=1e-6)


def test_pulled_cage_against_a_slow_loop(generator: torch.Generator) -> None:
    cloud = (2 * torch.rand(60, 3, generator=generator) - 1) * torch.tensor([1.0, 0.4, 0.1])
    cage = pulled_in_cage(cloud[None])[0]
    slow = icosphere(1)[0].double().numpy() * 1.4
    for _ in range(100):
        for i, vertex in enumerate(slow):
            if np.linalg.norm(cloud.double().numpy() - vertex, axis=1).min() > CLEARANCE:
                slow[i] = vertex * PULL_RATE
    np.testing.assert_allclose(cage, slow, atol=1e-5)


def test_pulled_vertices_stop_at_the_clearance(generator: torch.Generator) -> None:
    cloud = torch.nn.functional.normalize(torch.randn(4000, 3, generator=generator), dim=1) * 0.8
    cage = pulled_in_cage(cloud[None])[0]
    gap = torch.cdist(cage, cloud).amin(1)
    step = 1.4 * (1 - PULL_RATE)
    assert (gap <= CLEARANCE + 1e-5).all()
    assert (gap >= CLEARANCE - step - 1e-5).all()


def test_a_cage_depends_on_its_own_shape_alone(generator: torch.Generator) -> None:
    points = 2 * torch.rand(3, 50, 3, generator=generator) - 1
    for build in (pulled_in_cage, enclosing_cage):
        together = build(points)
        alone = torch.cat([build(points[i : i + 1, torch.randperm(50, generator=generator)]) for i in range(3)])
        torch.testing.assert_close(together, alone)
