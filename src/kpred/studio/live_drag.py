"""A drag as it happens: the latest place of the hand wins, the mesh follows, and a pause ends the gesture."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from threading import Condition, Thread

import numpy as np

from kpred.errors import KpredError
from kpred.studio.drag import Drag
from kpred.studio.gestures import Axis, MoveKeypoint
from kpred.studio.session import Session
from kpred.studio.shape import Shape
from kpred.studio.state import State

PAUSE = 0.35
"""Seconds without a motion after which a drag counts as a gesture."""

GOES_ON = 0.8
"""Seconds after that in which another motion goes on with the same gesture: the hand only rested."""


@dataclass(frozen=True, eq=False)
class Motion:
    """One place of the hand.

    Attributes:
        keypoint: that is dragged; place: (3,), scan's frame and unit; mirror, axis: the locks.
    """

    keypoint: int
    place: np.ndarray
    mirror: bool
    axis: Axis | None

    def same_drag(self, other: Motion) -> bool:
        """Return whether both belong to one drag."""
        return (self.keypoint, self.mirror, self.axis) == (other.keypoint, other.mirror, other.axis)


class LiveDrag:
    """Follows the hand in a thread of its own, so that places which come faster than meshes are skipped.

    Args:
        session: that the gestures go to; show: draws a shape of the state; done: is given the state after a drag.
        failed: is given the sentence of an error.
    """

    def __init__(
        self,
        session: Session,
        show: Callable[[State, Shape], None],
        done: Callable[[State], None],
        failed: Callable[[str], None],
        pause: float = PAUSE,
    ) -> None:
        self._session, self._show, self._done, self._failed = session, show, done, failed
        self._pause = pause
        self._wake = Condition()
        self._next: Motion | None = None
        self._closed = False
        self._ended = 0.0
        Thread(target=self._run, name="kpred-studio-drag", daemon=True).start()

    def move(self, motion: Motion) -> None:
        """Take a place of the hand; returns at once."""
        with self._wake:
            self._next = motion
            self._wake.notify()

    def close(self) -> None:
        """End the thread; a drag that is going on is dropped unfinished."""
        with self._wake:
            self._closed = True
            self._wake.notify()

    def _run(self) -> None:
        drag: Drag | None = None
        last: Motion | None = None
        dropped = False
        while True:
            motion = self._wait(self._pause if last is not None and not dropped else None)
            if self._closed:
                return
            try:
                if motion is None:
                    dropped = self._finish(drag, last)
                    continue
                if last is not None and not motion.same_drag(last):
                    dropped = dropped or self._finish(drag, last)
                    drag = None
                if drag is None or (dropped and self._is_over(drag)):
                    drag = self._session.begin_drag(motion.keypoint, motion.mirror, motion.axis)
                self._show(drag.state, drag.shape(motion.place))
                last, dropped = motion, False
            except KpredError as error:
                drag = last = None
                self._failed(str(error))

    def _is_over(self, drag: Drag) -> bool:
        """Return whether a drag that was let go has ended: some time has passed, or something else was done."""
        return time.monotonic() - self._ended > self._pause + GOES_ON or not self._session.goes_on(drag)

    def _wait(self, seconds: float | None) -> Motion | None:
        """Wait for the latest place; None after a pause."""
        with self._wake:
            self._wake.wait_for(lambda: self._closed or self._next is not None, seconds)
            found, self._next = self._next, None
            return found

    def _finish(self, drag: Drag | None, last: Motion | None) -> bool:
        """Let go where the hand was last."""
        if drag is not None and last is not None:
            x, y, z = (float(value) for value in last.place)
            gesture = MoveKeypoint(last.keypoint, (x, y, z), last.mirror, last.axis)
            self._done(self._session.drop(gesture, drag))
            self._ended = time.monotonic()
        return True
