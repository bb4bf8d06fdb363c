"""Packing: what goes in comes out, with the precision promised."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kpred.database.arrays import DamagedArray, pack_array, unpack_array
from kpred.database.entry import POINT_STEP, VERTEX_BASIS_STEP, pack_arrays, pack_frame, unpack_frame
from kpred.errors import DatabaseError

shapes = st.lists(st.integers(0, 9), min_size=1, max_size=3).map(tuple)


@given(shapes, st.sampled_from(["<f4", "<i4", "<u2", "<i2", "<u1", "<i1"]), st.integers(0, 2**32 - 1))
def test_arrays_come_back_to_the_bit(shape, dtype, seed):
    rng = np.random.default_rng(seed)
    array = rng.integers(0, 30000 if dtype[2] != "1" else 128, size=shape).astype(dtype)
    back = unpack_array(**pack_array(array, dtype))
    assert back.shape == shape
    assert back.flags.writeable
    np.testing.assert_array_equal(back, array)


@given(shapes, st.sampled_from([POINT_STEP, VERTEX_BASIS_STEP]), st.floats(0.01, 1e4), st.integers(0, 2**32 - 1))
def test_stepped_arrays_are_within_half_a_step_at_any_magnitude(shape, step, size, seed):
    array = np.random.default_rng(seed).uniform(-size, size, size=shape).astype(np.float32)
    packed = pack_array(array, "<i2", step)
    back = unpack_array(**packed)
    assert back.dtype == np.float32
    # Beyond the integers float32 takes over, whose own spacing then adds to the error.
    np.testing.assert_allclose(back, array, rtol=1e-6, atol=step / 2)
    again = unpack_array(**pack_array(back, "<i2", step))
    np.testing.assert_array_equal(again, back)


def test_like_numbers_are_compressed_and_noise_is_left_alone(rng):
    assert pack_array(np.linspace(0, 1, 999), "<i2", POINT_STEP)["codec"] == "shuffle-zlib"
    coordinates = np.stack([np.full(500, 0.1), np.full(500, 0.7), np.linspace(0, 1, 500)], axis=1)
    columns = pack_array(coordinates, "<f4")
    assert columns["codec"] == "columns-zlib"
    np.testing.assert_array_equal(unpack_array(**columns), coordinates.astype(np.float32))
    noise = rng.integers(0, 256, size=(500, 4), dtype=np.uint8).view("<i4")
    assert pack_array(noise, "<i4")["codec"] == "raw"


def test_a_cut_blob_is_an_error_and_not_wrong_numbers():
    packed = pack_array(np.linspace(0, 1, 999), "<i2", POINT_STEP)
    with pytest.raises(DamagedArray):
        unpack_array(**{**packed, "data": packed["data"][:-7]})
    for change in ({"codec": "lz4"}, {"shape": "998"}, {"shape": "x"}, {"dtype": "nothing"}):
        with pytest.raises(DamagedArray):
            unpack_array(**{**packed, **change})


def test_frame_comes_back_to_the_bit(random_entry):
    frame = random_entry("a").frame
    back = unpack_frame(pack_frame(frame))
    np.testing.assert_array_equal(back.rotation, frame.rotation)
    np.testing.assert_array_equal(back.center, frame.center)
    assert back.scale == frame.scale


def test_rounding_twice_is_rounding_once(random_entry, assert_same):
    entry = random_entry("a")
    assert_same(entry.rounded(), entry)


def test_meshes_of_many_vertices_keep_their_faces(random_entry):
    entry = random_entry("a", vertices=70_000, faces=500)
    columns = pack_arrays(entry)["faces"]
    np.testing.assert_array_equal(unpack_array(**columns), entry.mesh.faces)


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"model_id": ""}, "id"),
        ({"tokens": np.zeros((11, 128), np.float32)}, "tokens"),
        ({"keypoints": np.zeros((12, 2), np.float32)}, "keypoints"),
        ({"point_basis": np.zeros((63, 12), np.float32)}, "point_basis"),
        ({"vertex_basis": np.full((20, 12), np.nan, np.float32)}, "vertex_basis"),
        ({"tokens": np.full((12, 128), 1e6, np.float32)}, "float16"),
        ({"point_parts": np.zeros(63, np.int16)}, "point_parts"),
        ({"point_parts": np.full(64, 3, np.int16)}, "point_parts.*0 to 2"),
        ({"point_normals": np.full((64, 3), np.nan, np.float32)}, "point_normals"),
        ({"point_normals": np.full((64, 3), 2.0, np.float32)}, "point_normals"),
    ],
)
def test_arrays_that_do_not_fit_each_other_are_refused(random_entry, change, word):
    with pytest.raises(DatabaseError, match=word):
        replace(random_entry("a"), **change).check()
