"""Exact search equals its reference, in any order and with ties."""

import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from search_reference import reference_search

from kpred.database.search import TokenIndex, nearest
from kpred.errors import DatabaseError


def names(count):
    return tuple(f"m{i:05d}" for i in range(count))


@given(st.integers(1, 40), st.integers(1, 12), st.integers(1, 30), st.integers(1, 50), st.booleans(), st.integers(0))
def test_search_equals_the_reference(models, keypoints, size, top_k, weighted, seed):
    rng = np.random.default_rng(seed)
    tokens = rng.normal(size=(models, keypoints, size)).astype(np.float32)
    query = rng.normal(size=(keypoints, size)).astype(np.float32)
    weights = rng.uniform(0.01, 1, size=keypoints).astype(np.float32) if weighted else None
    found = TokenIndex(names(models), tokens).search(query, weights, top_k)
    wanted = reference_search(names(models), tokens, query, weights, top_k)
    np.testing.assert_allclose(found.distances, wanted.distances, rtol=1e-4)
    assert len(found.model_ids) == min(top_k, models)
    assert (np.diff(found.distances) >= 0).all()
    if np.diff(wanted.distances, prepend=-1).min() > 1e-3:
        assert found.model_ids == wanted.model_ids


@pytest.mark.parametrize("top_k", [1, 2, 3, 7, 10])
def test_ties_go_by_id(top_k):
    # Whole numbers add up exactly, so that equal distances are equal; every third model is the same.
    tokens = (np.arange(10)[:, None, None] % 3 * np.ones((10, 12, 8))).astype(np.float32)
    found = TokenIndex(names(10), tokens).search(np.zeros((12, 8), np.float32), None, top_k)
    wanted = reference_search(names(10), tokens, np.zeros((12, 8), np.float32), None, top_k)
    assert found.model_ids == wanted.model_ids
    np.testing.assert_array_equal(found.distances, wanted.distances)


def test_a_model_finds_itself_and_hidden_keypoints_do_not_count(rng):
    tokens = rng.normal(size=(50, 12, 128)).astype(np.float32)
    index = TokenIndex(names(50), tokens)
    query = tokens[7].copy()
    assert index.search(query).model_ids[0] == "m00007"
    assert index.search(query).distances[0] == 0
    query[3:] = 99.0
    weights = np.array([1.0] * 3 + [0.0] * 9, np.float32)
    found = index.search(query, weights)
    assert (found.model_ids[0], found.distances[0]) == ("m00007", 0)


def test_weights_are_a_scale_when_all_equal(rng):
    index = TokenIndex(names(30), rng.normal(size=(30, 12, 16)).astype(np.float32))
    query = rng.normal(size=(12, 16)).astype(np.float32)
    plain, scaled = index.search(query), index.search(query, np.full(12, 0.5))
    assert plain.model_ids == scaled.model_ids
    np.testing.assert_allclose(scaled.distances, plain.distances / 2, rtol=1e-6)


@pytest.mark.parametrize("weights", [np.ones(11), -np.ones(12), np.full(12, np.nan), np.zeros(12)])
def test_weights_that_cannot_weigh_are_refused(rng, weights):
    index = TokenIndex(names(3), rng.normal(size=(3, 12, 16)).astype(np.float32))
    with pytest.raises(DatabaseError, match="weights"):
        index.search(np.zeros((12, 16), np.float32), weights)


def test_queries_that_do_not_fit_are_refused(rng):
    index = TokenIndex(names(3), rng.normal(size=(3, 12, 16)).astype(np.float32))
    with pytest.raises(DatabaseError, match="16"):
        index.search(np.zeros((12, 8), np.float32))
    with pytest.raises(DatabaseError, match="finite"):
        index.search(np.full((12, 16), np.nan, np.float32))
    with pytest.raises(DatabaseError, match="at least 1"):
        nearest(names(3), np.zeros(3, np.float32), 0)


def test_a_thousand_models_are_searched_in_five_milliseconds(rng):
    index = TokenIndex(names(1000), rng.normal(size=(1000, 12, 128)).astype(np.float32))
    query = rng.normal(size=(12, 128)).astype(np.float32)
    weights = rng.uniform(size=12).astype(np.float32)
    times = []
    for _ in range(20):
        start = time.thread_time()  # one thread's own time tells the same on a busy machine
        index.search(query, weights)
        times.append(time.thread_time() - start)
    assert min(times) < 0.005
