"""Laws of frames: exact inversion, the unit box, invariance under similarities, refusals."""

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from kpred.errors import ScanError
from kpred.ops.frames import Frame, unit_box_frame


def _cloud(rng: np.random.Generator, count: int = 50) -> np.ndarray:
    return rng.normal(size=(count, 3)) * [1.0, 3.0, 0.4]


@given(
    seed=st.integers(0, 10_000),
    scale=st.floats(1e-3, 1e4),
    shift=st.floats(-1e3, 1e3),
)
def test_from_unit_inverts_to_unit(seed: int, scale: float, shift: float) -> None:
    rng = np.random.default_rng(seed)
    frame = Frame(rng.normal(size=3) * shift, scale, Rotation.random(rng=seed).as_matrix())
    points = rng.normal(size=(20, 3)) * scale + frame.center
    size = np.abs(points).max() + scale
    np.testing.assert_allclose(frame.from_unit(frame.to_unit(points)), points, atol=1e-13 * size)
    unit = rng.uniform(-1, 1, (20, 3))
    np.testing.assert_allclose(frame.to_unit(frame.from_unit(unit)), unit, atol=1e-13 * size / scale)


def test_definition_against_a_loop(rng: np.random.Generator) -> None:
    rotation = Rotation.from_euler("y", 40, degrees=True).as_matrix()
    frame = Frame(np.array([1.0, -2.0, 0.5]), 3.0, rotation)
    points = _cloud(rng, 5)
    slow = np.array([rotation @ (x - frame.center) / 3.0 for x in points])
    np.testing.assert_allclose(frame.to_unit(points), slow, rtol=1e-12)
    homogeneous = np.concatenate([slow, np.ones((5, 1))], axis=1)
    np.testing.assert_allclose((homogeneous @ frame.matrix().T)[:, :3], points, rtol=1e-12)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_torch_and_numpy_agree_and_keep_their_type(rng: np.random.Generator, dtype: torch.dtype) -> None:
    frame = unit_box_frame(_cloud(rng), Rotation.from_euler("x", 25, degrees=True).as_matrix())
    points = rng.normal(size=(2, 7, 3))
    tensor = torch.as_tensor(points, dtype=dtype)
    as_torch, as_numpy = frame.to_unit(tensor), frame.to_unit(tensor.numpy())
    assert as_torch.dtype == dtype
    assert as_numpy.dtype == tensor.numpy().dtype
    np.testing.assert_allclose(as_torch.numpy(), as_numpy, rtol=1e-5, atol=1e-6)
    back = frame.from_unit(as_torch)
    assert back.dtype == dtype
    np.testing.assert_allclose(back.numpy(), points, atol=1e-13 if dtype == torch.float64 else 2e-6)


@pytest.mark.parametrize("turned", [False, True])
def test_points_fill_the_unit_box(rng: np.random.Generator, turned: bool) -> None:
    points = _cloud(rng) + [100.0, -3.0, 7.0]
    rotation = Rotation.from_euler("zyx", [10, 50, -30], degrees=True).as_matrix() if turned else None
    unit = unit_box_frame(points, rotation).to_unit(points)
    low, high = unit.min(0), unit.max(0)
    np.testing.assert_allclose(low, -high, atol=1e-12)
    assert np.abs(unit).max() == pytest.approx(1.0, abs=1e-12)


@given(seed=st.integers(0, 10_000), scale=st.floats(1e-2, 1e2))
def test_unit_points_do_not_depend_on_the_outside_world(seed: int, scale: float) -> None:
    rng = np.random.default_rng(seed)
    points = _cloud(rng)
    world = Rotation.random(rng=seed).as_matrix()
    moved = scale * points @ world.T + rng.normal(size=3) * 10
    expected = unit_box_frame(points).to_unit(points)
    np.testing.assert_allclose(unit_box_frame(moved, world.T).to_unit(moved), expected, atol=1e-10)


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (np.zeros((0, 3)), "N > 0"),
        (np.zeros((4, 2)), r"\(4, 2\)"),
        (np.ones((10, 3)), "coincide"),
        (np.array([[0.0, 0, 0], [np.nan, 1, 1]]), "NaN or infinite"),
        (np.array([[0.0, 0, 0], [np.inf, 1, 1]]), "NaN or infinite"),
    ],
)
def test_degenerate_clouds_are_refused(points: np.ndarray, message: str) -> None:
    with pytest.raises(ScanError, match=message):
        unit_box_frame(points)


@pytest.mark.parametrize("scale", [0.0, -1.0, np.nan, np.inf])
def test_a_frame_without_size_is_refused(scale: float) -> None:
    with pytest.raises(ScanError, match="positive scale"):
        Frame(np.zeros(3), scale)
