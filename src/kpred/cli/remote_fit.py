"""A fit by a running server: what is sent, and how its files are written as those of a local fit are."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from kpred.cli.output import Output

if TYPE_CHECKING:
    from kpred.cli.fit import FitCommand

VARIABLE = "KPRED_SERVER"
"""Environment variable that names a server for all fits that one can do."""


def server_of(command: FitCommand) -> str | None:
    """Return the address of the server that fits; None for a fit here.

    A server has its own model and database, and reads no files: a server of the environment is left out where the
    command names some.
    """
    if command.server is not None:
        return command.server
    return None if own_resources(command) else os.environ.get(VARIABLE) or None


def own_resources(command: FitCommand) -> str | None:
    """Return the option that names something that a server does not have; None if there is none."""
    if command.model is not None:
        return "--model"
    if command.database is not None:
        return "--database"
    return "--pose" if command.pose not in (None, "identity", "upright") else None


def fit_remotely(command: FitCommand, address: str, target: Path, output: Output) -> tuple[dict[str, Any], list[Path]]:
    """Let a server fit, write the files that it returns, and return the record and the files.

    Raises:
        KpredError: the server is not there, or the scan cannot be fitted.
    """
    from kpred._version import __version__
    from kpred.atomic import write_together
    from kpred.json_output import json_text
    from kpred.server.client import request_fit
    from kpred.server.job import REPORT, named_record

    answer = request_fit(address, command.scan, form_of(command, target))
    for note in answer.notes:
        output.caution(note)
    if answer.version != __version__:
        output.caution(f"the server runs kpred {answer.version}, this is {__version__}: results may differ")
    record = named_record(answer.record, str(command.scan), os.path.abspath(command.scan), str(target))
    text = json_text(record)
    writers: dict[Path, Callable[[Path], object]] = {}
    for name, content in answer.files.items():
        file = command.report if name == REPORT and command.report is not None else target.with_name(name)
        writers[file] = _writer(text.encode() if file == target.with_suffix(".json") else content)
    write_together(writers)
    return record, list(writers)


def form_of(command: FitCommand, target: Path) -> dict[str, str]:
    """Return the fields of the form (`kpred.server.form.FitForm`), without those that are left as they are."""
    start = type(command)
    fields: dict[str, Any] = {"name": target.stem, "format": target.suffix}
    for name in (
        "category",
        "up",
        "unit",
        "frame",
        "pose",
        "partial",
        "deform",
        "top_k",
        "model_id",
        "floor",
        "density",
    ):
        value = getattr(command, name)
        if value is not None and value != getattr(start, name):
            fields[name] = value
    if command.sensor is not None:
        fields["sensor"] = " ".join(map(repr, command.sensor))
    if not command.clean:
        fields["clean"] = "false"
    for name in ("cleaning", "structure", "refinement"):
        settings = getattr(command, name)
        if settings != type(settings)():
            fields[name] = json.dumps(asdict(settings))
    fields["picture"] = "true" if command.picture else "false"
    fields["report"] = "false" if command.report is None else "true"
    return {key: repr(value) if isinstance(value, float) else str(value) for key, value in fields.items()}


def _writer(content: bytes) -> Callable[[Path], object]:
    return lambda file: file.write_bytes(content)
