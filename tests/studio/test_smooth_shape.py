"""Corrections of a shape that bends with its keypoints."""

import numpy as np
import pytest

from kpred.errors import ConfigError
from kpred.studio.gestures import WHOLE
from kpred.studio.shape import Held
from kpred.studio.smooth_shape import SmoothModel, SmoothShape


@pytest.fixture
def sheet(rng: np.random.Generator) -> SmoothShape:
    """A square sheet that follows its four corners bilinearly."""
    corners = np.array([[-1.0, 0, -1], [-1, 0, 1], [1, 0, -1], [1, 0, 1]])
    places = rng.uniform(-1, 1, (600, 2))
    u, v = ((places + 1) / 2).T
    basis = np.stack([(1 - u) * (1 - v), (1 - u) * v, u * (1 - v), u * v], axis=1)
    points = basis @ corners
    model = SmoothModel(points, corners, points, basis, basis)
    return SmoothShape(model, np.zeros((4, 3)))


def test_a_dragged_keypoint_is_where_the_hand_is_and_others_stay(sheet: SmoothShape) -> None:
    place = np.array([1.2, 0.3, 1.1])
    moved = sheet.pull((3,), Held())(place[None])
    np.testing.assert_allclose(moved.keypoints[3], place)
    np.testing.assert_array_equal(moved.keypoints[:3], sheet.keypoints[:3])


def test_refitting_finds_the_sheet_again_but_for_pinned_corners(sheet: SmoothShape) -> None:
    goal = sheet.vertices + [0.0, 0.08, 0.0]
    found = sheet.refit(goal, Held({0: sheet.keypoints[0]}))
    np.testing.assert_array_equal(found.keypoints[0], sheet.keypoints[0])
    # The corner that is pinned tilts its surroundings; the opposite one hardly.
    assert np.abs(found.vertices[:, 1] - 0.08).mean() < 0.3 * 0.08
    assert found.keypoints[3, 1] == pytest.approx(0.08, abs=0.02)


def test_sizes_of_parts_are_refused(sheet: SmoothShape) -> None:
    assert sheet.sizes(WHOLE)[0] == pytest.approx(2.0, abs=0.02)
    with pytest.raises(ConfigError, match="deform modes"):
        sheet.sizes(0)
    with pytest.raises(ConfigError, match="deform modes"):
        sheet.resize(WHOLE, 0, 1.0, Held())
