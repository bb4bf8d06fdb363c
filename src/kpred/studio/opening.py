"""What studio opens: a scan, or the record of a session with its scan beside it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from kpred.errors import ConfigError
from kpred.fitting.options import FitOptions
from kpred.fitting.stages import Context
from kpred.shapes.scan import read_scan
from kpred.studio.gestures import Gesture
from kpred.studio.record import Record, read_record
from kpred.studio.state import State


@dataclass(frozen=True, eq=False)
class Opened:
    """A scan, fitted, and the gestures that were done to it.

    Attributes:
        start: the fit; name: of the scan's file; gestures: of the record, none for a scan.
    """

    start: State
    name: str
    gestures: tuple[Gesture, ...] = ()


def open_scan(scan: Path, context: Context, options: FitOptions) -> Opened:
    """Read and fit a scan.

    Raises:
        KpredError: it cannot be read or fitted.
    """
    return Opened(State.of(read_scan(scan), context, options), scan.name)


def open_record(path: Path, scan: Path | None, context: Context) -> Opened:
    """Read the record of a session and fit its scan as it was fitted then.

    Args:
        scan: its file; None: the file of the recorded name beside the record. No other file is read.

    Raises:
        KpredError: the record or the scan cannot be read, or the scan or the networks are others.
    """
    record = read_record(path)
    beside = path.with_name(record.scan) if scan is None else scan
    if scan is None and not beside.is_file():
        raise ConfigError(f"{path}: the scan {record.scan} is not beside it; give it with --scan.")
    points = read_scan(beside)
    record.check_scan(points, str(beside))
    recorded = replace(context, categories=_categories(record, context, path))
    record.check_networks(recorded)
    return Opened(State.of(points, recorded, record.fit_options()), beside.name, record.gestures)


def _categories(record: Record, context: Context, path: Path) -> tuple[str, ...]:
    missing = [one for one in record.categories if one not in context.categories]
    if missing or not record.categories:
        name = missing[0][:40] if missing else ""
        raise ConfigError(f"{path}: networks or database have no category {name!r}; give those of the record.")
    return record.categories
