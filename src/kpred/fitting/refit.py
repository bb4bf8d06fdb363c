"""Making a fit again from its record, to the bit."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from kpred.database import Database
from kpred.errors import ConfigError, DatabaseError, ModelError, RecordError
from kpred.fitting.defaults import resolve_database, resolve_model, shared_categories
from kpred.fitting.options import FitOptions
from kpred.fitting.pipeline import Timer, run_fit
from kpred.fitting.record import BUNDLED_DATABASE, RECORD_VERSION, versions
from kpred.fitting.result import Fit
from kpred.fitting.source import mesh_sha256, scan_sha256
from kpred.fitting.stages import Context
from kpred.nn import Model
from kpred.nn.fingerprint import weights_fingerprint
from kpred.preprocessing.config import CleanConfig
from kpred.refinement.config import RefineConfig
from kpred.refinement.structure_config import StructureConfig


@dataclass(frozen=True, eq=False)
class Record:
    """A record that was read: `file` it is in, and its `content`."""

    file: Path
    content: Mapping[str, Any]

    @property
    def scan(self) -> Path:
        """The scan's file: where the record says, or the file of that name beside the record."""
        named = Path(self.content["input"]["path"])
        beside = self.file.parent / named.name
        return beside if not named.exists() and beside.exists() else named


def read_record(path: str | os.PathLike[str]) -> Record:
    """Read a record that a fit can be made from again.

    Raises:
        RecordError: it is missing, none, newer than this program, or of a fit whose scan is in no file.
    """
    file = Path(path)
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise RecordError(f"{file}: {error.strerror or error}; give the record that kpred fit wrote.") from error
    except (ValueError, RecursionError) as error:
        raise RecordError(f"{file}: it is no readable JSON; give the record that kpred fit wrote.") from error
    if isinstance(content, dict) and "studio" in content:
        raise RecordError(f"{file}: it is the record of a session of kpred studio; open it there.")
    if not isinstance(content, dict) or not isinstance(content.get("record_version"), int):
        raise RecordError(f"{file}: it is no record that can be repeated; fit the scan again with this version.")
    if content["record_version"] > RECORD_VERSION:
        raise RecordError(f"{file}: it was written by kpred {content.get('kpred')}; use that version or a newer one.")
    try:
        is_array = content["input"]["path"] is None
    except (KeyError, TypeError) as error:
        raise RecordError(f"{file}: the scan is missing in the record; fit the scan again.") from error
    if is_array:
        raise RecordError(
            f"{file}: its scan came from no file (depth pictures, an array); run the first command again."
        )
    return Record(file, content)


def refit(
    record: Record | str | os.PathLike[str],
    scan: str | os.PathLike[str] | None = None,
    model: Model | str | os.PathLike[str] | None = None,
    database: Database | str | os.PathLike[str] | None = None,
    *,
    exact: bool = True,
) -> Fit:
    """Make a fit again from its record; with `exact` its mesh is the record's, to the bit.

    Args:
        record: it, or its file.
        scan, model, database: where they are now, if not where the record says.

    Raises:
        RecordError: the record cannot be used; or scan, weights or database are not those of the record; or, with
            `exact`, the mesh differs because the versions do.
        ScanError, ModelError, DatabaseError: they are missing or damaged.
    """
    found = record if isinstance(record, Record) else read_record(record)
    try:
        return _refit(found, scan, model, database, exact)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise RecordError(f"{found.file}: the record is damaged ({error}); fit the scan again.") from error


def _refit(
    record: Record,
    scan: str | os.PathLike[str] | None,
    model: Model | str | os.PathLike[str] | None,
    database: Database | str | os.PathLike[str] | None,
    exact: bool,
) -> Fit:
    content, where = record.content, record.file
    options = options_from_json(content["options"], where)
    file = record.scan if scan is None else Path(scan)
    if scan_sha256(file) != content["input"]["sha256"]:
        raise RecordError(f"{where}: the scan {file} has changed since; give the scan it was made from (--scan).")
    networks = _model(content["weights"]["model"] if model is None else model, where)
    if weights_fingerprint(networks) != content["weights"]["fingerprint"]:
        raise RecordError(f"{where}: the weights {networks.name} have changed since; give the former ones (--model).")
    place = content["database"]["path"]
    store = _database((None if place == BUNDLED_DATABASE else place) if database is None else database, where)
    if store.fingerprint() != content["database"]["fingerprint"]:
        raise RecordError(f"{where}: the database {store.path} has changed since; give the former one (--database).")
    shared_categories(networks, store, None)
    context = Context(networks, store, tuple(str(name) for name in content["options"]["categories"]))
    fit = run_fit(file, context, options, Timer())
    same = mesh_sha256(np.asarray(fit.mesh.vertices), np.asarray(fit.mesh.faces)) == content["mesh_sha256"]
    if exact and not same:
        raise RecordError(f"{where}: the mesh differs from the record's, {_why(content)}; --inexact writes it anyway.")
    return fit


def options_from_json(values: Mapping[str, Any], where: Path) -> FitOptions:
    """Return the options that a record holds.

    Raises:
        RecordError: a value is impossible, or the pose came from an object that no record can hold.
    """
    pose = values["pose"]
    if isinstance(pose, str) and pose.startswith("<"):
        raise RecordError(f"{where}: its pose came from a Python object {pose}; run the fit in Python again.")
    clean = values["clean"]
    sensors = values["sensors"]
    try:
        return FitOptions(
            top_k=values["top_k"],
            frame=values["frame"],
            deform=values["deform"],
            partial=values["partial"],
            up=values["up"],
            pose=pose,
            clean=clean if isinstance(clean, bool) else CleanConfig(**clean),
            seed=values["seed"],
            model_id=values["model_id"],
            refinement=RefineConfig(**values["refinement"]),
            structure=StructureConfig(**values["structure"]),
            sensors=None if sensors is None else np.array(sensors, dtype=np.float64),
            floor=values["floor"],
            unit=values["unit"],
        )
    except (ConfigError, TypeError) as error:
        raise RecordError(f"{where}: its options are not those of this version ({error}).") from error


def _model(model: Model | str | os.PathLike[str], where: Path) -> Model:
    try:
        return resolve_model(model)
    except ModelError as error:
        raise ModelError(f"{where}: the weights are missing: {error}") from error


def _database(database: Database | str | os.PathLike[str] | None, where: Path) -> Database:
    try:
        return resolve_database(database)
    except DatabaseError as error:
        raise DatabaseError(f"{where}: the database is missing: {error}") from error


def _why(content: Mapping[str, Any]) -> str:
    """Explain why numbers differ although all inputs are the same."""
    now = versions()
    before = content.get("versions", {})
    other = [f"{name} was {before.get(name)}, is {now[name]}" for name in now if before.get(name) != now[name]]
    return "; ".join(other) if other else "though all versions are the same: another processor, or other threads"
