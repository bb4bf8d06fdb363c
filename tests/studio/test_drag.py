"""Dragging: a drag equals the gesture that it ends as; mirror lock and axis lock."""

import numpy as np
import pytest

from kpred.studio.drag import Drag
from kpred.studio.gestures import MoveKeypoint
from kpred.studio.session import Session
from kpred.studio.state import State


def _pair(state: State) -> tuple[int, int]:
    pairs = state.mirror_pairs
    return next((one, other) for one, other in enumerate(pairs) if other not in (-1, one))


def test_the_shape_under_the_hand_is_that_of_the_gesture(start: State) -> None:
    session = Session(start)
    place = start.keypoints[0] + [0.01, 0.03, 0.0]
    drag = session.begin_drag(0)
    preview = drag.shape(place)
    x, y, z = place
    dropped = session.drop(MoveKeypoint(0, (x, y, z)), drag)
    np.testing.assert_array_equal(dropped.shape.vertices, preview.vertices)
    again = Session.replay(start, session.gestures)
    np.testing.assert_array_equal(again.state.vertices, session.state.vertices)


def test_a_drag_that_another_gesture_overtook_is_done_on_what_is_there_now(start: State) -> None:
    session = Session(start)
    drag = session.begin_drag(0)
    x, y, z = start.keypoints[0] + 0.02
    session.do(MoveKeypoint(1, (x, y, z)))
    state = session.drop(MoveKeypoint(0, (x, y, z)), drag)
    assert set(state.pins) == {0, 1}
    replayed = Session.replay(start, session.gestures).state
    np.testing.assert_array_equal(replayed.vertices, state.vertices)


def test_axis_lock_moves_along_one_axis_of_the_object_alone(start: State) -> None:
    drag = Drag.begin(start, 3, axis="x")
    frame, before = start.fit.frame, start.shape.keypoints[3]
    locked = drag.shape(frame.from_unit(before + [0.05, 0.2, -0.3]))
    straight = drag.shape(frame.from_unit(before + [0.05, 0.0, 0.0]))
    np.testing.assert_allclose(locked.vertices, straight.vertices, atol=1e-9)


def test_mirror_lock_moves_both_sides_alike(start: State) -> None:
    one, other = _pair(start)
    before = start.shape.keypoints
    place = start.fit.frame.from_unit(before[one] + [0.06, 0.05, 0.04])
    state = Drag.begin(start, one, mirror=True).dropped(place)
    assert {one, other} <= set(state.pins)
    moved = state.shape.keypoints - before
    np.testing.assert_allclose(moved[one] * (-1, 1, 1), moved[other], atol=0.01)


@pytest.mark.parametrize("keypoint", [-1, 12])
def test_unknown_keypoints_are_refused(start: State, keypoint: int) -> None:
    from kpred.errors import ConfigError

    with pytest.raises(ConfigError, match="no keypoint"):
        Drag.begin(start, keypoint)
