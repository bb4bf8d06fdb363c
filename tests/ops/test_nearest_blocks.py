"""Nearest neighbours by blocks say what brute force says, to the bit, for whatever clouds and threads."""

import multiprocessing
from functools import partial

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from kpred.ops import worksharing
from kpred.ops.nearest import nearest_neighbours, nearest_reference
from kpred.ops.nearest_blocks import CELLS, CURVE, nearest_blocks
from kpred.ops.nearest_cpu import nearest_brute


def _same(query: np.ndarray, reference: np.ndarray) -> None:
    for found, expected in zip(nearest_blocks(query, reference), nearest_brute(query, reference), strict=True):
        np.testing.assert_array_equal(found, expected)


def _surface(generator: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    points = generator.normal(size=(*shape, 3))
    points /= np.abs(points).max(axis=-1, keepdims=True)
    return points.astype(np.float32)


@given(
    seed=st.integers(0, 9999),
    batch=st.integers(1, 3),
    n=st.integers(1, 200),
    m=st.integers(1, 200),
    spread=st.sampled_from([0.0, 1e-30, 1e-3, 1.0, 1e3, 1e18]),
    levels=st.sampled_from([0, 2, 9]),
)
def test_blocks_are_brute_force_to_the_bit(seed: int, batch: int, n: int, m: int, spread: float, levels: int) -> None:
    """Also where many points are equally near: coordinates of a few levels."""
    generator = np.random.default_rng(seed)
    query, reference = generator.normal(size=(batch, n, 3)), generator.normal(size=(batch, m, 3))
    if levels:
        query, reference = np.round(levels * query), np.round(levels * reference)
    _same((spread * query).astype(np.float32), (spread * reference).astype(np.float32))


def test_strays_and_clouds_far_apart_stay_exact() -> None:
    generator = np.random.default_rng(0)
    query, reference = _surface(generator, (2, 900)), _surface(generator, (2, 1000))
    query[0, 5], query[1, 7], reference[0, 3] = (1e4, 0, 0), (-3, 2e6, 1), (0, 5e5, 0)
    _same(query, reference)
    _same(query + np.float32(100), reference)
    distance, index = nearest_blocks(query, reference)
    plain, plain_index = nearest_reference(torch.from_numpy(query), torch.from_numpy(reference))
    np.testing.assert_allclose(distance, plain, rtol=1e-5)
    np.testing.assert_array_equal(index, plain_index)


def test_points_that_are_no_numbers_harm_nobody() -> None:
    generator = np.random.default_rng(1)
    query, reference = _surface(generator, (1, 800)), _surface(generator, (1, 800))
    clean = nearest_brute(query, reference)
    query[0, 100], query[0, 200] = np.nan, np.inf
    _, index = nearest_blocks(query, reference)
    assert ((index >= 0) & (index < 800)).all()
    others = np.delete(np.arange(800), [100, 200])
    assert (index[0, others] == clean[1][0, others]).mean() > 0.9  # those of the same group may be lost with it


def test_one_cloud_stands_for_the_batch() -> None:
    generator = torch.Generator().manual_seed(2)
    one, many = torch.randn(1, 900, 3, generator=generator), torch.randn(3, 850, 3, generator=generator)
    expanded = one.expand(3, -1, -1)
    for query, reference in ((expanded, many), (many, expanded), (expanded, expanded)):
        distance, index = nearest_neighbours(query, reference)
        plain, plain_index = nearest_neighbours(query.clone(), reference.clone())
        assert torch.equal(distance, plain)
        assert torch.equal(index, plain_index)


def test_the_curve_visits_every_cell_and_always_goes_to_a_neighbour() -> None:
    cells = np.argsort(CURVE)
    assert (np.sort(CURVE) == np.arange(CELLS**3)).all()
    places = np.stack(np.unravel_index(cells, (CELLS,) * 3))
    assert (np.abs(np.diff(places)).sum(axis=0) == 1).all()


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize(("queries", "references"), [((3, 1000), (3, 33_400)), ((1, 100_000), (1, 800))])
def test_threads_share_the_work_and_not_the_result(
    queries: tuple[int, int], references: tuple[int, int], threads: int, request: pytest.FixtureRequest
) -> None:
    """Both are long enough for threads in the search and in one of the sorts before it."""
    assert 20 * max(queries[0] * queries[1], references[0] * references[1]) >= worksharing.MIN_STEPS
    request.addfinalizer(partial(torch.set_num_threads, torch.get_num_threads()))
    generator = np.random.default_rng(3)
    query, reference = _surface(generator, queries), _surface(generator, references)
    torch.set_num_threads(1)
    plain = nearest_brute(query, reference)
    torch.set_num_threads(threads)
    for search in (nearest_blocks, nearest_brute):
        for found, expected in zip(search(query, reference), plain, strict=True):
            np.testing.assert_array_equal(found, expected)


def test_every_job_is_done_once_and_errors_come_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(worksharing, "thread_count", lambda: 3)
    done = np.zeros(10, dtype=int)

    def kernel(first: int, last: int) -> None:
        done[first:last] += 1
        if first > 0 and last == 10:
            raise ValueError("of another thread")

    with pytest.raises(ValueError, match="another thread"):
        worksharing.parallel_for(kernel, 10, 10 * worksharing.MIN_STEPS)
    assert (done == 1).all()


@pytest.mark.skipif("fork" not in multiprocessing.get_all_start_methods(), reason="no fork here")
def test_a_forked_child_makes_threads_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(worksharing, "thread_count", lambda: 2)
    worksharing.parallel_for(lambda first, last: None, 4, 4 * worksharing.MIN_STEPS)
    context = multiprocessing.get_context("fork")
    child = context.Process(
        target=worksharing.parallel_for, args=(lambda first, last: None, 4, 4 * worksharing.MIN_STEPS)
    )
    child.start()
    child.join(20)
    assert child.exitcode == 0
