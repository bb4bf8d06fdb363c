"""Bases as differences along a curve: they come back to the bit, smaller, and damage is noticed."""

import zlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kpred.database.arrays import DamagedArray, on_grid, pack_array
from kpred.database.curve_coding import CODEC, OLD_CODEC, curve_order, pack_along_curve, unpack_along_curve

STEP = 2.0**-9


def _smooth(places: np.ndarray, columns: int) -> np.ndarray:
    """A basis that changes smoothly with the place, as those of cages do."""
    centres = np.random.default_rng(1).uniform(-1, 1, (columns, 3))
    return np.exp(-np.square(places[:, None] - centres).sum(axis=2)).astype(np.float32)


@given(
    seed=st.integers(0, 999),
    count=st.integers(1, 300),
    columns=st.integers(1, 14),
    scale=st.sampled_from([1e-3, 1.0, 60.0, 3000.0]),
    distinct=st.booleans(),
)
def test_bases_come_back_to_the_bit(seed: int, count: int, columns: int, scale: float, distinct: bool) -> None:
    rng = np.random.default_rng(seed)
    places = rng.uniform(-1, 1, (count, 3)).astype(np.float32) if distinct else np.ones((count, 3), np.float32)
    basis = (scale * rng.normal(size=(count, columns))).astype(np.float32)
    packed = pack_along_curve(basis, "<i2", STEP, places)
    if packed["codec"] == CODEC:
        found = unpack_along_curve(**packed, places=places)
        np.testing.assert_array_equal(found, on_grid(basis, STEP))
        assert found.dtype == np.float32


def test_smooth_bases_take_less_room() -> None:
    places = np.random.default_rng(0).uniform(-1, 1, (2048, 3)).astype(np.float32)
    basis = _smooth(places, 12)
    packed = pack_along_curve(basis, "<i2", STEP, places)
    assert packed["codec"] == CODEC
    assert len(packed["data"]) < 0.75 * len(pack_array(basis, "<i2", STEP)["data"])


def test_older_databases_are_read() -> None:
    places = np.random.default_rng(0).uniform(-1, 1, (300, 3)).astype(np.float32)
    basis = on_grid(_smooth(places, 5), STEP)
    steps = np.diff(np.rint(basis / STEP).astype("<i2")[curve_order(places)], axis=0, prepend=np.zeros((1, 5), "<i2"))
    folded = (steps << 1) ^ (steps >> 15)
    data = zlib.compress(np.frombuffer(folded.T.tobytes(), np.uint8).reshape(-1, 2).T.tobytes())
    found = unpack_along_curve("<i2", "300,5", STEP, OLD_CODEC, data, places)
    np.testing.assert_array_equal(found, basis)


def test_neighbours_on_the_curve_are_near_each_other() -> None:
    places = np.random.default_rng(0).uniform(-1, 1, (2048, 3)).astype(np.float32)
    order = curve_order(places)
    assert sorted(order) == list(range(2048))
    along = np.linalg.norm(np.diff(places[order], axis=0), axis=1).mean()
    assert along < 0.25 * np.linalg.norm(np.diff(places, axis=0), axis=1).mean()


def test_damage_is_noticed() -> None:
    places = np.random.default_rng(0).uniform(-1, 1, (500, 3)).astype(np.float32)
    packed = pack_along_curve(_smooth(places, 12), "<i2", STEP, places)
    assert packed["codec"] == CODEC
    for change in ({"data": packed["data"][:-9]}, {"shape": "500,11"}, {"shape": "500"}, {"dtype": "<x2"}):
        with pytest.raises(DamagedArray, match=CODEC):
            unpack_along_curve(**{**packed, **change}, places=places)
    with pytest.raises(DamagedArray):
        unpack_along_curve(**packed, places=places[:-1])
