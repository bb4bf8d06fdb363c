"""Symmetries of solids that everyone can tell, and yaw errors that do not count them."""

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from kpred.evaluation.metrics.symmetry import (
    HALF_TURN,
    NONE,
    OF_SCAN2CAD,
    QUARTER_TURN,
    ROUND,
    SYMMETRIES,
    Symmetry,
    turned,
    vertical_symmetry,
    yaw_between,
    yaw_error,
)
from kpred.ops.rotations import upright_rotation, yaw_rotation


def box(*size: float, at: tuple[float, float, float] = (0, 0, 0)) -> trimesh.Trimesh:
    return trimesh.creation.box(size, trimesh.transformations.translation_matrix(at))


def upright_cylinder(radius: float, height: float) -> trimesh.Trimesh:
    lying = trimesh.creation.cylinder(radius, height, sections=48)
    lying.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0]))
    return lying


def open_case(depth: float = 0.4) -> trimesh.Trimesh:
    """A bookcase: sides, top, bottom and back, and no front."""
    boards = [
        box(0.02, 1.6, depth, at=(-0.4, 0, 0)),
        box(0.02, 1.6, depth, at=(0.4, 0, 0)),
        *(box(0.8, 0.02, depth, at=(0, height, 0)) for height in (-0.8, -0.3, 0.3, 0.8)),
        box(0.8, 1.6, 0.02, at=(0, 0, -depth / 2)),
    ]
    return trimesh.util.concatenate(boards)


SOLIDS: dict[str, tuple[trimesh.Trimesh, Symmetry]] = {
    "long box": (box(1.0, 0.7, 0.5), HALF_TURN),
    "square box": (box(0.6, 1.0, 0.6), QUARTER_TURN),
    "square column": (box(0.3, 2.0, 0.3), QUARTER_TURN),
    "narrow column": (box(0.36, 2.0, 0.3), HALF_TURN),
    "cylinder": (upright_cylinder(0.4, 0.9), ROUND),
    "chair": (trimesh.util.concatenate([box(0.5, 0.45, 0.5), box(0.5, 0.5, 0.06, at=(0, 0.45, -0.22))]), NONE),
    "bookcase": (open_case(), NONE),
}


@pytest.mark.parametrize("name", SOLIDS)
@pytest.mark.parametrize("yaw", [0.0, 37.0])
def test_symmetry_of_solids(name: str, yaw: float) -> None:
    mesh, symmetry = SOLIDS[name]
    points = trimesh.sample.sample_surface(mesh, 8192, seed=0)[0]
    assert vertical_symmetry(turned(points, yaw) * 40 + [3, -7, 1]) == symmetry


def test_a_line_is_round() -> None:
    assert vertical_symmetry(np.linspace([1, 0, 2], [1, 3, 2], 100)) == ROUND


def test_turned_is_the_yaw_rotation() -> None:
    points = np.random.default_rng(0).normal(size=(5, 3))
    np.testing.assert_allclose(turned(points, 30.0), points @ yaw_rotation(np.radians(30)).T, atol=1e-12)


@given(st.floats(-180, 180), st.floats(-180, 180), st.sampled_from(["y", "z", "-x"]))
def test_yaw_between_is_the_turn_that_was_added(first: float, added: float, up: str) -> None:
    true = yaw_rotation(np.radians(first)) @ upright_rotation(up)
    found = yaw_rotation(np.radians(added)) @ true
    assert np.cos(np.radians(yaw_between(found, true) - added)) == pytest.approx(1)


@given(st.floats(-720, 720), st.integers(-8, 8), st.sampled_from(SYMMETRIES))
def test_turns_of_the_symmetry_are_no_error(degrees: float, times: int, symmetry: Symmetry) -> None:
    error = yaw_error(degrees, symmetry)
    assert 0 <= error <= symmetry.step / 2
    assert yaw_error(-degrees, symmetry) == pytest.approx(error, abs=1e-9)
    assert yaw_error(degrees + times * symmetry.step, symmetry) == pytest.approx(error, abs=1e-9)


def test_yaw_errors_of_known_turns() -> None:
    assert [yaw_error(170.0, symmetry) for symmetry in SYMMETRIES] == [170, 10, 10, 0]
    assert yaw_error(50.0, QUARTER_TURN) == 40
    assert OF_SCAN2CAD.get("__SYM_NONE", NONE) == NONE
