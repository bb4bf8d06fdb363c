"""The record of a session: JSON that replays to the same mesh, given the same scan, database and networks."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import NoneType
from typing import Any, TypeVar

import numpy as np

from kpred._version import __version__
from kpred.errors import ConfigError
from kpred.fitting.options import FitOptions
from kpred.fitting.stages import Context
from kpred.json_output import json_text
from kpred.studio.gestures import Gesture, from_json, to_json
from kpred.studio.session import MAX_GESTURES, Session

Parsed = TypeVar("Parsed")

SCHEMA = 1
"""Version of the record's layout; readers refuse newer ones."""

MAX_BYTES = 10_000_000
"""Size of a record; a larger file is none."""

OPTIONS: dict[str, tuple[type, ...]] = {
    "top_k": (int,),
    "frame": (str,),
    "deform": (str,),
    "partial": (bool, NoneType),
    "up": (str,),
    "seed": (int,),
    "model_id": (str, NoneType),
    "floor": (int, float, NoneType),
    "unit": (str,),
}
"""Options of the first fit that a record holds, with their types; studio leaves all others at their defaults."""


@dataclass(frozen=True, eq=False)
class Record:
    """What a record of a session holds.

    Attributes:
        scan: name of its file, without folder; scan_sha256: of its points.
        categories: that were searched first; options: of the first fit; fingerprints: of the networks by category.
        gestures: in their order; vertices_sha256: of the mesh that they led to.
    """

    scan: str
    scan_sha256: str
    categories: tuple[str, ...]
    options: Mapping[str, Any]
    fingerprints: Mapping[str, str]
    gestures: tuple[Gesture, ...]
    vertices_sha256: str

    def check_scan(self, points: np.ndarray, name: str) -> None:
        """Refuse a scan other than the one that was recorded.

        Raises:
            ConfigError: its points differ.
        """
        if array_sha256(points) != self.scan_sha256:
            raise ConfigError(f"{name}: it is not the scan {self.scan} that the record was made with; give that one.")

    def check_networks(self, context: Context) -> None:
        """Refuse networks other than those that were recorded.

        Raises:
            ConfigError: the weights of a category differ.
        """
        for category, fingerprint in self.fingerprints.items():
            if category not in context.model or context.model[category].fingerprint() != fingerprint:
                raise ConfigError(
                    f"The record was made with other networks of the category {category[:40]!r}; give them as --model."
                )

    def fit_options(self) -> FitOptions:
        """Return the options of the first fit."""
        return FitOptions(**self.options)


def session_record(session: Session, scan: str) -> str:
    """Write the record of a session as JSON text; `scan` is the name of the scan's file."""
    start, state = session.start, session.state
    return json_text(
        {
            "kpred": __version__,
            "studio": SCHEMA,
            "scan": {"name": Path(scan).name, "points": len(start.points), "sha256": array_sha256(start.points)},
            "categories": start.context.categories,
            "options": {name: getattr(start.options, name) for name in OPTIONS},
            "networks": {one: start.context.model[one].fingerprint() for one in start.context.categories},
            "gestures": [to_json(gesture) for gesture in session.gestures],
            "result": {
                "model_id": state.fit.source.model_id,
                "category": state.fit.category,
                "vertices_sha256": array_sha256(state.vertices),
            },
        }
    )


def is_record(path: Path) -> bool:
    """Find out whether a file says that it is a record, by its extension."""
    return path.suffix.lower() == ".json"


def is_fit_record(path: Path) -> bool:
    """Find out whether a file is the record that `kpred fit` wrote, not one of studio."""
    try:
        content = json.loads(path.read_text(encoding="utf-8")) if path.stat().st_size <= MAX_BYTES else None
    except (OSError, ValueError, RecursionError):
        return False
    return isinstance(content, dict) and "record_version" in content and "studio" not in content


def read_record(path: Path) -> Record:
    """Read the record of a session, of any origin; nothing that it names is opened.

    Raises:
        ConfigError: the file is missing or no record, or a newer kpred made it.
    """
    content = read_content(path)
    if "room" in content:
        raise ConfigError(f"{path}: it is the record of a room; give the room as --scan.")
    return parse_record(path, content, _record)


def parse_record(path: Path, content: dict[str, Any], parse: Callable[[dict[str, Any]], Parsed]) -> Parsed:
    """Call `parse` on the content of a record; whatever it stumbles over becomes a ConfigError that names the file."""
    try:
        return parse(content)
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}") from error
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise ConfigError(f"{path}: the record is damaged; save the session again.") from error


def read_content(path: Path) -> dict[str, Any]:
    """Read the JSON of a record, of any origin, of a scan or of a room.

    Raises:
        ConfigError: the file is missing or no record, or a newer kpred made it.
    """
    try:
        if path.stat().st_size > MAX_BYTES:
            raise ConfigError(f"{path}: it is too large to be a record of kpred studio.")
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise ConfigError(f"{path}: it cannot be read as a record of kpred studio; save the session again.") from error
    schema = content.get("studio") if isinstance(content, dict) else None
    if not isinstance(schema, int) or isinstance(schema, bool):
        raise ConfigError(f"{path}: it is no record of kpred studio; give a scan, or the record of a session.")
    if schema > SCHEMA:
        raise ConfigError(f"{path}: a newer version of kpred made this record; update kpred.")
    found: dict[str, Any] = content
    return found


def array_sha256(array: np.ndarray) -> str:
    """Compute the SHA-256 of the numbers of an array, as float64."""
    return hashlib.sha256(np.ascontiguousarray(array, dtype=np.float64).tobytes()).hexdigest()


def _record(content: Mapping[str, Any]) -> Record:
    scan, options = content["scan"], content["options"]
    if unknown := set(options) - set(OPTIONS):
        raise ConfigError(f"the record has an unknown option {sorted(unknown)[0][:40]!r}.")
    if wrong := [name for name, value in options.items() if type(value) not in OPTIONS[name]]:
        raise ConfigError(f"the record's option {wrong[0]!r} has a value of a wrong type.")
    if len(content["gestures"]) > MAX_GESTURES:
        raise ConfigError(f"the record has more than {MAX_GESTURES} gestures.")
    record = Record(
        scan=Path(text(scan["name"])).name,
        scan_sha256=text(scan["sha256"]),
        categories=tuple(text(one) for one in content["categories"]),
        options=dict(options),
        fingerprints={text(key): text(value) for key, value in content["networks"].items()},
        gestures=tuple(from_json(gesture) for gesture in content["gestures"]),
        vertices_sha256=text(content["result"]["vertices_sha256"]),
    )
    record.fit_options()
    return record


def text(value: Any) -> str:
    """Return a value that has to be text, or raise ValueError."""
    if not isinstance(value, str):
        raise ValueError(value)
    return value
