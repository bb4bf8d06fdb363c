"""Mean value coordinates: their laws, and a slow scalar version after Ju, Schaefer and Warren (2005), Fig. 4."""

import math

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from kpred.ops.cage import enclosing_cage, icosphere
from kpred.ops.mean_value import mean_value_coordinates, mean_value_reference


def slow_coordinates(point: np.ndarray, vertices: np.ndarray, faces: np.ndarray, eps: float = 1e-10) -> np.ndarray:
    """The paper's pseudo-code for one point, with the weight of each vertex in place of the interpolated function."""
    offset = vertices - point
    d = np.linalg.norm(offset, axis=1)
    if d.min() < eps:
        return np.eye(len(vertices))[d.argmin()]
    u = offset / d[:, None]
    total = np.zeros(len(vertices))
    for face in faces:
        length = [np.linalg.norm(u[face[(i + 1) % 3]] - u[face[(i + 2) % 3]]) for i in range(3)]
        theta = [2 * math.asin(min(x / 2, 1.0)) for x in length]
        h = sum(theta) / 2
        if math.pi - h < 1e-9:
            weights = np.zeros(len(vertices))
            for i in range(3):
                weights[face[i]] += math.sin(theta[i]) * d[face[(i + 1) % 3]] * d[face[(i + 2) % 3]]
            return weights / weights.sum()
        c, s = [], []
        sign = np.sign(np.linalg.det(u[face]))
        for i in range(3):
            sines = math.sin(theta[(i + 1) % 3]) * math.sin(theta[(i + 2) % 3])
            c.append(2 * math.sin(h) * math.sin(h - theta[i]) / sines - 1)
            s.append(sign * math.sqrt(max(0.0, 1 - c[i] ** 2)))
        if min(abs(x) for x in s) <= 1e-9:
            continue
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            total[face[i]] += (theta[i] - c[j] * theta[k] - c[k] * theta[j]) / (d[face[i]] * math.sin(theta[j]) * s[k])
    return total / total.sum()


def _cage(seed: int, dtype: torch.dtype = torch.float64, batch: int = 1) -> torch.Tensor:
    """Star-shaped and not convex: the icosphere with random radii."""
    generator = torch.Generator().manual_seed(seed)
    radii = 0.8 + 0.8 * torch.rand(batch, 42, 1, generator=generator, dtype=torch.float64)
    return (icosphere(1)[0].double() * radii).to(dtype)


def _points(
    seed: int, count: int, dtype: torch.dtype = torch.float64, batch: int = 1, size: float = 1.0
) -> torch.Tensor:
    generator = torch.Generator().manual_seed(seed + 1)
    return ((2 * torch.rand(batch, count, 3, generator=generator, dtype=torch.float64) - 1) * size).to(dtype)


FACES = icosphere(1)[1]


BOTH = pytest.mark.parametrize("coordinates", [mean_value_coordinates, mean_value_reference], ids=["compiled", "torch"])


@BOTH
@pytest.mark.parametrize("size", [0.5, 1.0, 3.0], ids=["inside", "both", "mostly outside"])
def test_agreement_with_the_slow_scalar_reference(coordinates, size: float) -> None:
    cage, points = _cage(0), _points(0, 25, size=size)
    fast = coordinates(points, cage, FACES)[0].numpy()
    slow = [slow_coordinates(p, cage[0].numpy(), FACES.numpy()) for p in points[0].numpy()]
    np.testing.assert_allclose(fast, slow, atol=1e-8)


@given(seed=st.integers(0, 99_999), size=st.sampled_from([0.3, 1.0, 2.5]), single=st.booleans())
def test_partition_of_unity_and_linear_precision(seed: int, size: float, single: bool) -> None:
    dtype = torch.float32 if single else torch.float64
    cage, points = _cage(seed, dtype, 2), _points(seed, 30, dtype, 2, size)
    weights = mean_value_coordinates(points, cage, FACES)
    assert weights.dtype == dtype
    assert weights.shape == (2, 30, 42)
    # Outside, coordinates may be large with either sign, and rounding grows with them.
    tolerance = (1e-6 if single else 1e-12) * (1 + weights.abs().sum(-1).max().item()) * 10
    assert (weights.sum(-1) - 1).abs().max() < tolerance
    assert (weights @ cage - points).abs().max() < tolerance


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_deformation_laws(dtype: torch.dtype) -> None:
    cage, points = _cage(1, dtype), _points(1, 200, dtype, size=0.6)
    weights = mean_value_coordinates(points, cage, FACES)
    tolerance = 5e-6 if dtype == torch.float32 else 1e-12
    identity = points + weights @ torch.zeros_like(cage)
    assert torch.equal(identity, points)
    matrix = torch.tensor([[1.2, 0.3, 0.0], [-0.1, 0.7, 0.2], [0.4, 0.0, 1.1]], dtype=dtype)
    shift = torch.tensor([0.5, -1.0, 2.0], dtype=dtype)
    moved = points + weights @ (cage @ matrix + shift - cage)
    assert (moved - (points @ matrix + shift)).abs().max() < tolerance


@given(seed=st.integers(0, 99_999), scale=st.sampled_from([1e-3, 0.1, 1.0, 50.0]))
def test_similarities_leave_the_coordinates_alone(seed: int, scale: float) -> None:
    cage, points = _cage(seed), _points(seed, 20, size=0.7)
    generator = torch.Generator().manual_seed(seed)
    turn, _ = torch.linalg.qr(torch.randn(3, 3, generator=generator, dtype=torch.float64))  # mirrors too
    shift = scale * torch.randn(3, generator=generator, dtype=torch.float64)
    weights = mean_value_coordinates(points, cage, FACES)
    moved = mean_value_coordinates(scale * points @ turn + shift, scale * cage @ turn + shift, FACES)
    torch.testing.assert_close(moved, weights, rtol=0, atol=1e-8)


def test_order_of_vertices_and_faces_does_not_matter(generator: torch.Generator) -> None:
    cage, points = _cage(2), _points(2, 50)
    weights = mean_value_coordinates(points, cage, FACES)
    order = torch.randperm(42, generator=generator)
    place = torch.argsort(order)
    shuffled = place[FACES][torch.randperm(80, generator=generator)].roll(1, 1)
    found = mean_value_coordinates(points, cage[:, order], shuffled)
    torch.testing.assert_close(found, weights[:, :, order], rtol=0, atol=1e-10)
    # Inside out, all weights of a point change sign before they are normalised.
    torch.testing.assert_close(mean_value_coordinates(points, cage, FACES.flip(1)), weights, rtol=0, atol=1e-10)


@BOTH
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_points_on_vertices_edges_and_faces(coordinates, dtype: torch.dtype) -> None:
    cage = _cage(3, dtype)
    vertices = cage[0]
    corners = vertices[FACES]
    barycentric = torch.tensor([0.2, 0.5, 0.3], dtype=dtype)
    on_faces = torch.einsum("i,fix->fx", barycentric, corners)
    on_edges = 0.75 * corners[:, 0] + 0.25 * corners[:, 1]
    weights = coordinates(torch.cat([vertices, on_faces, on_edges])[None], cage, FACES)[0]
    assert torch.isfinite(weights).all()
    rows = torch.arange(80)[:, None]
    face_rows = torch.zeros(80, 42, dtype=dtype)
    face_rows[rows, FACES] = barycentric.expand(80, 3)
    edge_rows = torch.zeros(80, 42, dtype=dtype)
    edge_rows[rows, FACES] = torch.tensor([0.75, 0.25, 0.0], dtype=dtype).expand(80, 3)
    expected = torch.cat([torch.eye(42, dtype=dtype), face_rows, edge_rows])
    tolerance = 1e-4 if dtype == torch.float32 else 1e-6
    torch.testing.assert_close(weights, expected, rtol=0, atol=tolerance)


@BOTH
@pytest.mark.parametrize("gap", [1e-3, 1e-5, 1e-7])
def test_continuous_toward_the_surface(coordinates, gap: float) -> None:
    """From within and from without, the coordinates come down to the limits on the face, an edge and a vertex."""
    cage = _cage(4)
    corners = cage[0][FACES[0]]
    for barycentric in ([0.3, 0.3, 0.4], [0.5, 0.5, 0.0], [1.0, 0.0, 0.0]):
        place = torch.tensor(barycentric, dtype=torch.float64) @ corners
        points = torch.stack([place * (1 - gap), place * (1 + gap)])[None]
        limit = torch.zeros(42, dtype=torch.float64).scatter_add_(0, FACES[0], torch.tensor(barycentric).double())
        weights = coordinates(points, cage, FACES)[0]
        assert (weights - limit).abs().max() < 30 * gap * (1 + abs(math.log(gap))) + 1e-5


def test_positive_inside_a_convex_cage() -> None:
    sphere = icosphere(1)[0].double()[None]
    weights = mean_value_coordinates(_points(5, 300, size=0.5), sphere, FACES)
    assert weights.min() > 0


def test_an_enclosing_cage_keeps_weights_bounded() -> None:
    """Box corners within the cage: no large weights of opposite sign, which would fold the shape there."""
    corners = torch.tensor([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])[None]
    weights = mean_value_coordinates(corners, enclosing_cage(corners), FACES)
    assert weights.abs().sum(-1).max() < 1.5


@BOTH
def test_batches_do_not_mix(coordinates) -> None:
    cages, points = _cage(6, batch=3), _points(6, 17, batch=3)
    together = coordinates(points, cages, FACES)
    alone = torch.cat([coordinates(points[i : i + 1], cages[i : i + 1], FACES) for i in range(3)])
    torch.testing.assert_close(together, alone, rtol=0, atol=1e-13)


def test_chunks_of_points_do_not_mix() -> None:
    cages, points = _cage(6, batch=3), _points(6, 17, batch=3)
    whole = mean_value_reference(points, cages, FACES)
    torch.testing.assert_close(mean_value_reference(points, cages, FACES, chunk=4), whole, rtol=0, atol=1e-13)


@given(seed=st.integers(0, 99_999), size=st.sampled_from([0.3, 1.0, 2.5]), single=st.booleans())
def test_compiled_and_torch_say_the_same(seed: int, size: float, single: bool) -> None:
    dtype = torch.float32 if single else torch.float64
    cage, points = _cage(seed, dtype, 2), _points(seed, 30, dtype, 2, size)
    compiled, plain = mean_value_coordinates(points, cage, FACES), mean_value_reference(points, cage, FACES)
    assert compiled.dtype == plain.dtype == dtype
    scale = 1 + plain.abs().max().item()
    torch.testing.assert_close(compiled, plain, rtol=0, atol=scale * (1e-6 if single else 1e-10))


def test_strided_and_differentiated_input() -> None:
    cage, points = _cage(7, batch=2), _points(7, 40, batch=2, size=0.5)
    every = mean_value_coordinates(points, cage, FACES)[:, ::2]
    torch.testing.assert_close(mean_value_coordinates(points[:, ::2], cage, FACES), every, rtol=0, atol=1e-13)
    cage.requires_grad_()
    weights = mean_value_coordinates(points, cage, FACES)
    assert weights.requires_grad
    # Linear precision holds for every cage, so that W C does not change with the cage.
    (weights @ cage).sum().backward()
    assert cage.grad is not None and cage.grad.abs().max() < 1e-8
