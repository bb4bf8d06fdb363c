"""What studio opens: a scan, the record of a fit, or the record of a session with its scan beside it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from kpred.errors import ConfigError
from kpred.fitting.options import FitOptions
from kpred.fitting.record import options_to_json
from kpred.fitting.refit import options_from_json
from kpred.fitting.refit import read_record as read_fit_record
from kpred.fitting.source import scan_sha256
from kpred.fitting.stages import Context
from kpred.json_output import plain
from kpred.nn.fingerprint import weights_fingerprint
from kpred.shapes.scan import read_scan
from kpred.studio.gestures import Gesture
from kpred.studio.record import OPTIONS, Record, read_record
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


def open_fit_record(path: Path, scan: Path | None, context: Context) -> Opened:
    """Open a fit by the record that `kpred fit` wrote of it: the same scan with the same options.

    Args:
        scan: its file; None: where the record says, or beside the record.

    Raises:
        KpredError: the record or the scan cannot be read; scan, networks or database are others; or the fit had options
            that the record of a session does not hold.
    """
    record = read_fit_record(path)
    file = record.scan if scan is None else scan
    try:
        wanted, options = record.content["options"], options_from_json(record.content["options"], path)
        kept = FitOptions(**{name: getattr(options, name) for name in OPTIONS})
        same = options_to_json(kept)
        if other := [name for name, value in same.items() if plain(value) != wanted.get(name)]:
            raise ConfigError(f"{path}: studio keeps no option {other[0]!r} of a fit; open the scan itself instead.")
        if scan_sha256(file) != record.content["input"]["sha256"]:
            raise ConfigError(f"{path}: the scan {file} has changed since; give the scan it was made from as --scan.")
        if context.database.fingerprint() != record.content["database"]["fingerprint"]:
            raise ConfigError(f"{path}: the fit was made with another database; give that as --database.")
        if weights_fingerprint(context.model) != record.content["weights"]["fingerprint"]:
            raise ConfigError(f"{path}: the fit was made with other networks; give those as --model.")
        categories = tuple(str(name) for name in wanted["categories"])
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise ConfigError(f"{path}: the record is damaged; fit the scan again.") from error
    return Opened(State.of(read_scan(file), replace(context, categories=categories), kept), file.name)


def _categories(record: Record, context: Context, path: Path) -> tuple[str, ...]:
    missing = [one for one in record.categories if one not in context.categories]
    if missing or not record.categories:
        name = missing[0][:40] if missing else ""
        raise ConfigError(f"{path}: networks or database have no category {name!r}; give those of the record.")
    return record.categories
