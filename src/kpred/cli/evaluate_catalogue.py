"""`kpred evaluate catalogue`: models of the database itself, scanned: found again, and left as they are?"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from kpred.cli.output import Output
from kpred.cli.scan_options import MeasuredFitsCommand
from kpred.cli.usage import UsageError


@dataclass(frozen=True, kw_only=True)
class CatalogueCommand(MeasuredFitsCommand):
    """Scan models of the database itself, and measure whether they are found again and left as they are.

    Each model is scanned by a virtual depth camera, with noise and outliers, in its own size, turned and moved. The fit
    is given the up axis and the category. Where the right model is the result, its distance from the true surface is
    compared with that of the same model undeformed in its place, and the thickness of its boards with its own.

    Scanned is the split `source` of the packs, which is searched too unless --database is given; without packs, models
    of the database.

    examples:
      kpred evaluate catalogue packs/ --limit 40 -o catalogue.json --picture catalogue.png
      kpred evaluate catalogue --database mine.kpred
      kpred evaluate catalogue packs/chair.npz --views 0 --json
    """

    packs: Annotated[Positional[tuple[Path, ...]], arg(metavar="[PACK ...]", help_behavior_hint="")] = ()
    """Mesh packs (.npz), or folders of them"""
    tiles: Annotated[int, arg(metavar="N")] = 18
    """How many of the worst results are on the contact sheet"""
    views: Annotated[int, arg(metavar="N")] = 1
    """Depth views of each model, taken together; 0: its whole surface"""
    limit: Annotated[int, arg(metavar="N")] = 40
    """At most so many models a category, drawn at random by the seed; 0: all of them"""

    def run(self, output: Output) -> None:
        """Measure with a progress bar, print and write."""
        from kpred.cli.progress import ProgressBar
        from kpred.evaluation.page import brief
        from kpred.evaluation.scans.catalogue import evaluate_catalogue
        from kpred.evaluation.scans.catalogue_pages import catalogue_pages
        from kpred.evaluation.scans.run import ScanConfig

        if self.tiles < 1:
            raise UsageError(f"--tiles must be at least 1, but is {self.tiles}")
        self.check()
        tiles = 0 if self.picture is None else self.tiles
        config = ScanConfig(self.views, self.limit or None, self.seed, self.top_k, tiles)
        with ProgressBar() as bar:
            report = evaluate_catalogue(self.packs, self.model, self.database, config, progress=bar.update)
        notes = [f"note: {sentence}" for sentence in brief(report.header["remarks"], 10)]
        failed = [outcome for _, outcome in report.outcomes if outcome.failure is not None]
        notes += [f"failed: {one.category} {one.model_id}: {one.failure}" for one in failed]
        self.finish(output, report.to_json(), report.tiles, catalogue_pages(report), notes)
