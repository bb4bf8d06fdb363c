"""A room in studio: a session for each of its objects, objects left out, and all of them together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from threading import RLock

from kpred.errors import ConfigError
from kpred.fitting.fit_room import LevelRoom
from kpred.fitting.fit_scene import SceneFit
from kpred.fitting.object_fit import ObjectFit
from kpred.fitting.stages import Context
from kpred.studio.editable import editable_shape
from kpred.studio.session import Session
from kpred.studio.state import State

LEFT_OUT = "it was left out by hand."


class RoomSession:
    """The corrections of one person to the objects of one room; objects that have no fit stay without one.

    Args:
        room: as it was fitted; name: of the scan's file; context: networks and database.
        options: of the fits; objects_file: name of the file that named the objects.
    """

    def __init__(
        self,
        room: LevelRoom,
        name: str,
        context: Context,
        options: Mapping[str, str],
        objects_file: str | None = None,
    ) -> None:
        self.room, self.name, self.context = room, name, context
        self.options, self.objects_file = dict(options), objects_file
        self._fitted = {item.object.name: item for item in room.fits if item.fit is not None}
        self._sessions: dict[str, Session] = {}
        self._left_out: set[str] = set()
        self._lock = RLock()

    @property
    def objects(self) -> tuple[str, ...]:
        """Names of the objects that have a fit, in the room's order."""
        return tuple(self._fitted)

    @property
    def sessions(self) -> Mapping[str, Session]:
        """The sessions that were begun, by object."""
        with self._lock:
            return dict(self._sessions)

    @property
    def left_out(self) -> frozenset[str]:
        """Objects that are left out of the result."""
        with self._lock:
            return frozenset(self._left_out)

    def copy(self) -> RoomSession:
        """Return another session of the room that begins where this one is."""
        with self._lock:
            made = RoomSession(self.room, self.name, self.context, self.options, self.objects_file)
            made._sessions = {name: session.copy() for name, session in self._sessions.items()}
            made._left_out = set(self._left_out)
            return made

    def session(self, name: str) -> Session:
        """Return the session of an object; it begins at its first use.

        Raises:
            ConfigError: the room has no such object, or it has no fit.
        """
        with self._lock:
            if name not in self._sessions:
                self._sessions[name] = Session(object_state(self._item(name)))
            return self._sessions[name]

    def leave_out(self, name: str, out: bool) -> None:
        """Leave an object out of the result, or take it in again.

        Raises:
            ConfigError: the room has no such object, or it has no fit.
        """
        self._item(name)
        with self._lock:
            if out:
                self._left_out.add(name)
            else:
                self._left_out.discard(name)

    def items(self) -> tuple[ObjectFit, ...]:
        """Return what became of all objects, as they were corrected, in the frame in which the room is level."""
        return tuple(self._corrected(item) for item in self.room.fits)

    def result(self) -> SceneFit:
        """Return the room as it was corrected, in the frame of the scan."""
        return self.room.in_scan(self.items())

    def _item(self, name: str) -> ObjectFit:
        if name not in self._fitted:
            raise ConfigError(f"The room has no object {name[:40]!r} with a fit; choose one of the list.")
        return self._fitted[name]

    def _corrected(self, item: ObjectFit) -> ObjectFit:
        name = item.object.name
        with self._lock:
            session, out = self._sessions.get(name), name in self._left_out
        if out:
            return replace(item, fit=None, error=f"{name}: {LEFT_OUT}")
        if session is None or not session.gestures:
            return item
        return replace(item, fit=session.state.result)


def object_state(item: ObjectFit) -> State:
    """Make the state that corrections of an object begin with: its fit as it stands in the room.

    Raises:
        ConfigError: it has no fit.
    """
    if item.fit is None:
        raise ConfigError(f"{item.object.name}: it has no fit that could be corrected.")
    made = item.fit.source_data
    shape = editable_shape(item.fit, made.options.structure)
    return State(item.object.points, made.context, made.options, item.fit, item.fit, shape)
