"""Rotations of named up axes."""

import numpy as np
import pytest

from kpred.errors import ConfigError
from kpred.ops.rotations import upright_rotation


@pytest.mark.parametrize("up", ["x", "y", "z", "-x", "-y", "-z"])
def test_upright_turns_the_up_axis_to_y(up: str) -> None:
    turn = upright_rotation(up)
    axis = np.eye(3)["xyz".index(up[-1])] * (-1 if up.startswith("-") else 1)
    np.testing.assert_array_equal(turn @ axis, [0, 1, 0])
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(turn) == pytest.approx(1)


def test_z_up_turns_as_documented() -> None:
    np.testing.assert_allclose(upright_rotation("z") @ [1, 2, 3], [1, 3, -2])


def test_other_axes_are_refused() -> None:
    with pytest.raises(ConfigError, match="must be one of x, y, z"):
        upright_rotation("w")
