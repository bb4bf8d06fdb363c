"""`kpred evaluate rooms`: furniture found in whole labelled rooms with nothing given, and the results together."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from kpred.cli.output import Output
from kpred.cli.scan_options import MeasuredFitsCommand


@dataclass(frozen=True, kw_only=True)
class RoomsCommand(MeasuredFitsCommand):
    """Measure `kpred scene ROOM` on labelled rooms: precision and recall of chairs, tables and cabinets.

    Rooms are room packs (`kpred data rooms`, of other seeds and shapes than any training) and folders of real ones:
    NAME.ply, NAME.instances.npy (instance of each point, 0 for none) and NAME.names.json (name of each). Overlap is
    that of points. Fitted rooms are measured for shared volume, for results off the floor, for the distance from scan
    to result and, where the true poses are known, by Scan2CAD's criterion (20 cm, 20 degrees, 20 % scale) as well.

    examples:
      kpred evaluate rooms val.npz rooms/ --detect-only
      kpred evaluate rooms rooms/ -o rooms.json --limit 5
    """

    paths: Annotated[Positional[tuple[Path, ...]], arg(metavar="PATH")]
    """Room packs (.npz) and folders of labelled rooms"""
    detect_only: Annotated[bool, arg(help_behavior_hint="")] = False
    """Measure which objects are found, and fit none"""
    limit: Annotated[int | None, arg(metavar="N")] = None
    """Most rooms of each path"""

    def run(self, output: Output) -> None:
        """Measure with a progress bar, print and write."""
        from kpred.cli.progress import ProgressBar
        from kpred.cli.usage import UsageError
        from kpred.evaluation.rooms.pages import room_notes, room_page, summary_page
        from kpred.evaluation.rooms.run import evaluate_rooms
        from kpred.evaluation.scans.outcome import FitSettings
        from kpred.fitting.defaults import resolve_database, resolve_model

        if not self.paths:
            raise UsageError("no rooms were named; try `kpred evaluate rooms PACK.npz`, or a folder of rooms")
        self.check()
        settings = FitSettings(resolve_model(self.model), resolve_database(self.database), self.top_k, self.seed)
        with ProgressBar() as bar:
            report = evaluate_rooms(self.paths, settings, not self.detect_only, self.limit, bar.update)
        self.finish(output, report.to_json(), [], (summary_page(report), room_page(report)), room_notes(report))
