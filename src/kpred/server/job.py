"""What the server hands to a worker, and what comes back; without imports, so that client and server load quickly."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

ANSWER, NOTES, VERSION = "kpred-answer", "kpred-notes", "kpred-version"
"""Headers of an answer: its kind, sentences about the scan (JSON), and the server's version."""

REPORT = "report.html"
"""Name of the page among the files of an answer."""

PORT = 8765


@dataclass(frozen=True)
class FitJob:
    """One scan to fit.

    Attributes:
        folder: of this job alone; scan: name of the upload in it; shown: what the user calls the scan.
        mesh: name of the mesh file to make, its extension included.
        options: of `kpred.fit`, plain values; settings of cleaning, structure and refinement as mappings.
        picture, report: whether these are made too; density: kg per cubic metre, for simulations.
    """

    folder: str
    scan: str
    shown: str
    mesh: str
    options: Mapping[str, Any]
    picture: bool = False
    report: bool = False
    density: float = 600.0


@dataclass(frozen=True)
class FitAnswer:
    """What became of a job.

    Attributes:
        files: name -> content, the mesh first; empty where it failed.
        record: of the fit.
        notes: sentences about the scan that the command line prints as warnings.
        error: one sentence; kind: name of the error's class, `TimeLimit` or `WorkerDied`; empty where all went well.
    """

    files: Mapping[str, bytes] = field(default_factory=dict)
    record: Mapping[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    error: str = ""
    kind: str = ""


def named_record(record: Mapping[str, Any], scan: str, path: str, mesh: str) -> dict[str, Any]:
    """Return a record with other names: of the scan as the user gave it, of its file, and of the mesh."""
    return {**record, "input": {**record["input"], "path": path}, "scan": scan, "mesh": mesh}
