"""`kpred evaluate scans`: virtual scans with nothing given but gravity, against the same with everything given."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from kpred.cli.output import Output
from kpred.cli.scan_options import MeasuredFitsCommand
from kpred.cli.usage import UsageError


@dataclass(frozen=True, kw_only=True)
class ScansCommand(MeasuredFitsCommand):
    """Measure fits of virtual scans of mesh packs, with nothing given but gravity.

    Every target is seen once by a virtual depth camera, with noise and outliers, turned, in some size and place. The
    same points are fitted again with frame, pose and category given. Errors are measured from the whole true surface.
    Without --database, the split `source` of all packs of a folder is searched. A pack of the category `other` holds
    things that are of none of the categories: the fit should doubt them.

    examples:
      kpred evaluate scans packs/chair.npz packs/table.npz packs/cabinet.npz
      kpred evaluate scans packs/ --limit 10 --picture worst.png -o rows.json
      kpred evaluate scans packs/ other.npz --model runs/mine/model --seed 1 --json
    """

    packs: Annotated[Positional[tuple[Path, ...]], arg(metavar="PACK [PACK ...]", help_behavior_hint="")]
    """Mesh packs (.npz), or folders of them"""
    worst: Annotated[int, arg(metavar="N")] = 12
    """How many of the worst targets are on the contact sheet, and half as many typical ones"""
    split: Annotated[str, arg(metavar="NAME")] = "val"
    """Whose shapes are the targets"""
    limit: Annotated[int, arg(metavar="N")] = 40
    """At most so many targets a pack, drawn at random by the seed; 0: all of them"""

    def run(self, output: Output) -> None:
        """Measure with a progress bar, print and write."""
        from kpred.cli.progress import ProgressBar
        from kpred.evaluation.page import brief
        from kpred.evaluation.scans.run import ScanConfig
        from kpred.evaluation.scans.scan_pages import scan_pages
        from kpred.evaluation.scans.virtual_scans import evaluate_scans

        if not self.packs:
            raise UsageError("no pack was named; try `kpred evaluate scans FILE.npz`")
        if self.worst < 1:
            raise UsageError(f"--worst must be at least 1, but is {self.worst}")
        self.check()
        tiles = 0 if self.picture is None else self.worst
        config = ScanConfig(limit=self.limit or None, seed=self.seed, top_k=self.top_k, tiles=tiles)
        with ProgressBar() as bar:
            report = evaluate_scans(
                self.packs,
                self.model,
                self.database,
                config,
                split=self.split,
                progress=bar.update,
                # The header holds what is left out; it is printed with the tables.
                report=lambda sentence: None,
            )
        notes = (f"note: {sentence}" for sentence in brief((*report.header["remarks"], *report.failures), 20))
        self.finish(output, report.to_json(), report.tiles, scan_pages(report), notes)
