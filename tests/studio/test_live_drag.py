"""A drag as it happens: places that come faster than meshes are skipped, a pause makes one gesture of many places."""

from threading import Event

import numpy as np

from kpred.studio.gestures import PinKeypoint
from kpred.studio.live_drag import LiveDrag, Motion
from kpred.studio.session import Session
from kpred.studio.state import State

LONG = 60.0


class _Hand:
    """A hand on a session: what was shown, and when a drag was done."""

    def __init__(self, start: State, pause: float = 0.05) -> None:
        self.session, self.shown = Session(start), 0
        self.done, self.failed = Event(), Event()
        self.drag = LiveDrag(self.session, self._show, lambda _: self.done.set(), self._fail, pause)

    def _show(self, state: State, shape: object) -> None:
        self.shown += 1

    def _fail(self, sentence: str) -> None:
        self.sentence = sentence
        self.failed.set()

    def move(self, place: np.ndarray, keypoint: int = 0) -> None:
        self.drag.move(Motion(keypoint, place, False, None))

    def rest(self) -> None:
        assert self.done.wait(LONG)
        self.done.clear()


def test_many_places_are_one_gesture_that_ends_at_the_last(start: State) -> None:
    hand = _Hand(start)
    for step in range(200):
        hand.move(start.keypoints[0] + [0.0, 0.0002 * step, 0.0])
    hand.rest()
    hand.drag.close()
    (gesture,) = hand.session.gestures
    np.testing.assert_allclose(gesture.place, start.keypoints[0] + [0.0, 0.0398, 0.0])
    assert 1 <= hand.shown <= 200
    np.testing.assert_array_equal(Session.replay(start, [gesture]).state.vertices, hand.session.state.vertices)


def test_a_hand_that_only_rested_goes_on_with_the_same_gesture(start: State) -> None:
    hand = _Hand(start)
    for height in (0.01, 0.03):
        hand.move(start.keypoints[0] + [0.0, height, 0.0])
        hand.rest()
    hand.drag.close()
    (gesture,) = hand.session.gestures
    np.testing.assert_allclose(gesture.place, start.keypoints[0] + [0.0, 0.03, 0.0])
    assert hand.session.undo() is start


def test_a_gesture_in_between_ends_the_drag(start: State) -> None:
    hand = _Hand(start)
    hand.move(start.keypoints[0] + [0.0, 0.01, 0.0])
    hand.rest()
    hand.session.do(PinKeypoint(3, True))
    hand.move(hand.session.state.keypoints[0] + [0.0, 0.03, 0.0])
    hand.rest()
    hand.drag.close()
    assert [type(one).__name__ for one in hand.session.gestures] == ["MoveKeypoint", "PinKeypoint", "MoveKeypoint"]


def test_another_keypoint_begins_another_gesture(start: State) -> None:
    hand = _Hand(start, pause=0.2)
    hand.move(start.keypoints[0] + [0.0, 0.01, 0.0])
    while not hand.shown:
        hand.done.wait(0.001)
    hand.move(start.keypoints[1] + [0.0, 0.01, 0.0], keypoint=1)
    hand.rest()
    hand.rest()
    hand.drag.close()
    assert [one.keypoint for one in hand.session.gestures] == [0, 1]


def test_an_unknown_keypoint_is_a_sentence(start: State) -> None:
    hand = _Hand(start)
    hand.move(np.zeros(3), keypoint=99)
    assert hand.failed.wait(LONG)
    hand.drag.close()
    assert "no keypoint 99" in hand.sentence
    assert hand.session.gestures == ()
