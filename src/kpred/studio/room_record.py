"""The record of a session on a room: JSON that replays, given the same room, networks and database."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from kpred._version import __version__
from kpred.errors import ConfigError
from kpred.json_output import json_text
from kpred.nn.fingerprint import weights_fingerprint
from kpred.studio.gestures import Gesture, from_json, to_json
from kpred.studio.record import SCHEMA, array_sha256, parse_record, read_content, text
from kpred.studio.room import RoomSession
from kpred.studio.session import MAX_GESTURES, Session


@dataclass(frozen=True, eq=False)
class RoomRecord:
    """What the record of a room holds.

    Attributes:
        scan: name of the room's file; scan_sha256: of its points; options: of its fits.
        objects: name of the file that named its objects; None where they were found.
        weights, database: fingerprints; gestures: of each corrected object; left_out: names of others.
    """

    scan: str
    scan_sha256: str
    options: Mapping[str, str]
    objects: str | None
    weights: str
    database: str
    gestures: Mapping[str, tuple[Gesture, ...]]
    left_out: tuple[str, ...]

    def check(self, room: RoomSession) -> None:
        """Refuse another room, other networks or another database than were recorded.

        Raises:
            ConfigError: they differ.
        """
        now = _fingerprints(room)
        if array_sha256(room.room.scan.points) != self.scan_sha256:
            raise ConfigError(f"{room.name}: it is not the room {self.scan} that the record was made with; give that.")
        for kind, before, option in (("weights", self.weights, "--model"), ("database", self.database, "--database")):
            if now[kind] != before:
                raise ConfigError(f"The record was made with another {kind}; give the former one as {option}.")

    def replay(self, room: RoomSession) -> None:
        """Repeat the gestures on a room as it was fitted.

        Raises:
            KpredError: a gesture cannot be done; the sentence names the object.
        """
        for name, gestures in self.gestures.items():
            session = room.session(name)
            for number, gesture in enumerate(gestures, start=1):
                try:
                    session.do(gesture)
                except ConfigError as error:
                    raise ConfigError(f"{name[:40]}: gesture {number} ({type(gesture).__name__}): {error}") from error
        for name in self.left_out:
            room.leave_out(name, True)


def room_record(room: RoomSession) -> str:
    """Write the record of a session on a room as JSON text."""
    points = room.room.scan.points
    sessions = {name: session for name, session in room.sessions.items() if session.gestures}
    return json_text(
        {
            "kpred": __version__,
            "studio": SCHEMA,
            "room": {"name": Path(room.name).name, "points": len(points), "sha256": array_sha256(points)},
            "options": dict(room.options),
            "objects_file": room.objects_file,
            **_fingerprints(room),
            "objects": {name: [to_json(one) for one in session.gestures] for name, session in sessions.items()},
            "left_out": sorted(room.left_out),
            "result": {name: _outcome(session) for name, session in sessions.items()},
        }
    )


def is_room_record(path: Path) -> bool:
    """Find out whether a record is that of a room.

    Raises:
        ConfigError: it cannot be read.
    """
    return "room" in read_content(path)


def read_room_record(path: Path) -> RoomRecord:
    """Read the record of a room, of any origin; nothing that it names is opened.

    Raises:
        ConfigError: it is missing, damaged, or of a newer kpred.
    """
    return parse_record(path, read_content(path), _record)


def _record(content: Mapping[str, Any]) -> RoomRecord:
    room, file = content["room"], content["objects_file"]
    gestures = {text(name): tuple(from_json(one) for one in list(given)) for name, given in content["objects"].items()}
    if any(len(given) > MAX_GESTURES for given in gestures.values()):
        raise ConfigError(f"the record has more than {MAX_GESTURES} gestures of one object.")
    return RoomRecord(
        scan=Path(text(room["name"])).name,
        scan_sha256=text(room["sha256"]),
        options={text(key): text(value) for key, value in content["options"].items()},
        objects=None if file is None else Path(text(file)).name,
        weights=text(content["weights"]),
        database=text(content["database"]),
        gestures=gestures,
        left_out=tuple(text(name) for name in content["left_out"]),
    )


def _fingerprints(room: RoomSession) -> dict[str, str]:
    context = room.context
    return {"weights": weights_fingerprint(context.model), "database": context.database.fingerprint()}


def _outcome(session: Session) -> dict[str, str]:
    state = session.state
    return {"model_id": state.fit.source.model_id, "vertices_sha256": array_sha256(np.asarray(state.vertices))}
