"""Codes bound every distance, and a table finds what the reference finds, to the bit."""

import os

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from search_reference import reference_search

from kpred.database.search import TokenIndex
from kpred.database.token_codes import CodeLayout, Quantiser, bounds, bounds_reference
from kpred.database.token_file import make_table, open_table
from kpred.database.token_table import GrowingIndex, TableKey
from kpred.errors import DatabaseError, OutputError

KEY = TableKey("chair", "weights-a", "epoch", 7)


def names(count):
    return [f"m{i * 7919 % count:05d}é" for i in range(count)]  # in no order


def table_of(ids, tokens, path=None, part=100):
    parts = ((ids[at : at + part], tokens[at : at + part]) for at in range(0, len(ids), part))
    return make_table(path, KEY, tokens.shape, parts)


def random_tokens(rng, models, keypoints, size, clusters):
    """Tokens in clusters, with copies among them, some dimensions constant."""
    centres = rng.normal(size=(clusters, keypoints, size))
    tokens = centres[rng.integers(0, clusters, models)] + 0.05 * rng.normal(size=(models, keypoints, size))
    tokens[:, :, 0] = 3.0
    tokens[models // 2 :: 3] = tokens[0]
    return tokens.astype(np.float16)


@given(
    models=st.integers(1, 700),
    keypoints=st.integers(1, 13),
    size=st.integers(1, 140),
    clusters=st.integers(1, 40),
    top_k=st.integers(1, 30),
    far=st.sampled_from([0.01, 1.0, 30.0]),
    weighted=st.booleans(),
    seed=st.integers(0),
)
def test_a_table_finds_what_the_reference_finds(models, keypoints, size, clusters, top_k, far, weighted, seed):
    rng = np.random.default_rng(seed)
    tokens = random_tokens(rng, models, keypoints, size, clusters)
    query = (tokens[-1] + far * rng.normal(size=(keypoints, size))).astype(np.float32)
    weights = rng.uniform(0, 1, keypoints).astype(np.float32) if weighted else None
    ids = names(models)
    wanted = reference_search(tuple(ids), tokens, query, weights, top_k)
    found = table_of(ids, tokens).search(query, weights, top_k)
    assert found.model_ids == wanted.model_ids
    np.testing.assert_array_equal(found.distances, wanted.distances)
    # The small index gives the same numbers, and so do a table and an index together.
    order = np.argsort(ids)
    small = TokenIndex(tuple(sorted(ids)), tokens[order].astype(np.float32)).search(query, weights, top_k)
    assert small.model_ids == wanted.model_ids
    np.testing.assert_array_equal(small.distances, wanted.distances)
    half = models // 2
    if half:
        late = np.argsort(ids[half:])
        later = TokenIndex(tuple(sorted(ids[half:])), tokens[half:][late].astype(np.float32))
        both = GrowingIndex(table_of(ids[:half], tokens[:half]), later)
        assert tuple(name for _, name in both.ranked(query, weights, top_k)) == wanted.model_ids
        assert both.model_ids == tuple(sorted(ids))


@given(st.integers(1, 60), st.integers(1, 7), st.integers(1, 130), st.floats(0.01, 20), st.integers(0))
def test_bounds_hold_for_every_model(models, keypoints, size, spread, seed):
    rng = np.random.default_rng(seed)
    tokens = (spread * rng.normal(size=(models, keypoints, size))).astype(np.float16)
    query = (2 * spread * rng.normal(size=(keypoints, size))).astype(np.float32)
    weights = rng.uniform(0, 2, keypoints)
    quantiser = Quantiser.of_range(tokens.min(axis=0), tokens.max(axis=0))
    codes, errors = quantiser.encode(tokens.astype(np.float32))
    layout = CodeLayout(keypoints, size)
    planes = np.ascontiguousarray(layout.planar(np.pad(codes, [(0, 0), (0, 0), (0, layout.size - size)])))
    planar_errors = np.ascontiguousarray(layout.planar(errors))
    low, high = bounds_reference(planes, planar_errors, quantiser, query, weights)
    exact = (np.abs(tokens.astype(np.float64) - query).sum(axis=2) * weights).sum(axis=1)
    tiny = 1e-9 * (1 + exact)
    assert (low <= exact + tiny).all()
    assert (exact <= high + tiny).all()
    # The compiled pass says the same of every model it does not give up, and gives up none of the nearest.
    top_k = min(5, models)
    lower, limit = bounds(planes, planar_errors, quantiser, query, weights, top_k)
    seen = np.isfinite(lower)
    np.testing.assert_allclose(lower[seen], low[seen], rtol=1e-5, atol=1e-30)
    assert limit == pytest.approx(np.sort(high)[top_k - 1], rel=1e-5)
    assert (exact[~seen] > np.sort(exact)[top_k - 1]).all()


def test_a_file_comes_back_and_what_is_no_table_does_not(tmp_path, rng):
    path = tmp_path / "a.kpred.tokens-1"
    tokens = random_tokens(rng, 500, 12, 128, 20)
    ids, query = names(500), tokens[3].astype(np.float32)
    told = []
    made = make_table(path, KEY, tokens.shape, iter([(ids, tokens)]), told.append)
    assert told == [500, 1000]
    again = open_table(path)
    assert again.key == KEY
    assert again.model_ids == tuple(sorted(ids))
    assert (
        again.search(query).model_ids == made.search(query).model_ids == table_of(ids, tokens).search(query).model_ids
    )
    assert [file.name for file in tmp_path.iterdir()] == [path.name]
    content = path.read_bytes()
    for damaged in (b"", b"nothing", content[:-1], content[: len(content) // 2], b"X" + content[1:], content[:9000]):
        path.write_bytes(damaged)
        assert open_table(path) is None
    assert open_table(tmp_path / "none") is None


def test_an_interrupted_table_leaves_no_file_and_an_abandoned_one_is_removed(tmp_path, rng):
    path = tmp_path / "a.kpred.tokens-1"
    tokens = random_tokens(rng, 10, 3, 5, 2)

    def rows():
        yield names(10)[:5], tokens[:5]
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        make_table(path, KEY, tokens.shape, rows())
    assert list(tmp_path.iterdir()) == []
    old, young = tmp_path / ".a.kpred.1.ab.tokens-1", tmp_path / ".a.kpred.2.ab.tokens-1"
    for file in (old, young):
        file.write_bytes(b"unfinished")
    os.utime(old, (1, 1))
    table_of(names(10), tokens, path)
    assert {file.name for file in tmp_path.iterdir()} == {path.name, young.name}
    with pytest.raises(OutputError, match="does not exist"):
        table_of(names(10), tokens, tmp_path / "missing" / "x.tokens-1")


def test_bad_queries_are_refused(rng):
    table = table_of(names(9), random_tokens(rng, 9, 3, 5, 2))
    with pytest.raises(DatabaseError, match="finite"):
        table.search(np.full((3, 5), np.nan))
    with pytest.raises(DatabaseError, match="weights"):
        table.search(np.zeros((3, 5)), np.zeros(3))
    with pytest.raises(DatabaseError, match="at least 1"):
        table.search(np.zeros((3, 5)), None, 0)


def test_every_damaged_byte_is_noticed(tmp_path, rng):
    tokens = random_tokens(rng, 60, 4, 8, 5)
    path = tmp_path / "tokens"
    table_of(names(60), tokens, path)
    whole = path.read_bytes()
    assert open_table(path) is not None
    used = [at for at in range(len(whole)) if whole[at]]
    for at in rng.choice(used, 200, replace=False).tolist():
        damaged = bytearray(whole)
        damaged[at] ^= 1 << int(rng.integers(8))
        path.write_bytes(bytes(damaged))
        assert open_table(path) is None, at
