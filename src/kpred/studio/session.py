"""A session: a scan, the gestures of one person, undo and redo."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from threading import RLock

import numpy as np

from kpred.errors import ConfigError
from kpred.studio.apply import apply
from kpred.studio.drag import Drag
from kpred.studio.gestures import Axis, Gesture, MoveKeypoint
from kpred.studio.state import State

MAX_GESTURES = 2000
"""Gestures of one session; a record with more was not made by a hand."""


@dataclass(frozen=True, eq=False)
class _Done:
    """A gesture and the state after it."""

    gesture: Gesture
    state: State
    drag: Drag | None = None


class Session:
    """The gestures of one person on one scan; safe to use from several threads.

    States are immutable, so that undo and redo are instant and many sessions may begin with the same state.
    """

    def __init__(self, start: State) -> None:
        self.start = start
        self._done: list[_Done] = []
        self._undone: list[_Done] = []
        self._lock = RLock()

    @classmethod
    def replay(cls, start: State, gestures: Sequence[Gesture]) -> Session:
        """Repeat the gestures of another session.

        Raises:
            KpredError: a gesture cannot be done; the sentence names it by its number.
        """
        session = cls(start)
        for number, gesture in enumerate(gestures, start=1):
            try:
                session.do(gesture)
            except ConfigError as error:
                raise ConfigError(f"Gesture {number} ({type(gesture).__name__}): {error}") from error
        return session

    def copy(self) -> Session:
        """Return another session that begins where this one is; neither notices what the other does."""
        with self._lock:
            made = Session(self.start)
            made._done, made._undone = list(self._done), list(self._undone)
            return made

    @property
    def state(self) -> State:
        """What is shown now."""
        with self._lock:
            return self._done[-1].state if self._done else self.start

    @property
    def gestures(self) -> tuple[Gesture, ...]:
        """The gestures that led to what is shown now."""
        with self._lock:
            return tuple(one.gesture for one in self._done)

    @property
    def can_undo(self) -> bool:
        """Whether there is a gesture to take back."""
        return bool(self._done)

    @property
    def can_redo(self) -> bool:
        """Whether a gesture that was taken back can be repeated."""
        return bool(self._undone)

    def do(self, gesture: Gesture) -> State:
        """Do a gesture; what was undone before is dropped. Nothing changes if it fails.

        Raises:
            KpredError: it cannot be done; the sentence says why.
        """
        with self._lock:
            return self._add(gesture, apply(gesture, self.state))

    def begin_drag(self, keypoint: int, mirror: bool = False, axis: Axis | None = None) -> Drag:
        """Take a keypoint into the hand; `drop` ends the gesture.

        Raises:
            ConfigError: there is no such keypoint.
        """
        with self._lock:
            return Drag.begin(self.state, keypoint, mirror, axis)

    def drop(self, gesture: MoveKeypoint, drag: Drag) -> State:
        """Let go of a dragged keypoint: a move, without computing its response again.

        A drag that goes on after it was let go replaces the gesture it ended as. One that another gesture has overtaken
        is done anew.
        """
        with self._lock:
            if self._done and self._done[-1].drag is drag:
                self._done.pop()
            if drag.state is not self.state:
                return self.do(gesture)
            x, y, z = gesture.place
            return self._add(gesture, drag.dropped(np.array([x, y, z])), drag)

    def goes_on(self, drag: Drag) -> bool:
        """Return whether a drag may go on: nothing was done since it began, but the gesture it ended as."""
        with self._lock:
            return drag.state is self.state or (bool(self._done) and self._done[-1].drag is drag)

    def undo(self) -> State:
        """Take back the last gesture, if there is one."""
        with self._lock:
            if self._done:
                self._undone.append(self._done.pop())
            return self.state

    def redo(self) -> State:
        """Repeat the gesture that was taken back last, if there is one."""
        with self._lock:
            if self._undone:
                self._done.append(self._undone.pop())
            return self.state

    def _add(self, gesture: Gesture, state: State, drag: Drag | None = None) -> State:
        if len(self._done) >= MAX_GESTURES:
            raise ConfigError(f"A session holds at most {MAX_GESTURES} gestures; save it and begin another.")
        self._done.append(_Done(gesture, state, drag))
        self._undone.clear()
        return state
