"""`kpred evaluate catalogue`: models of the database itself, scanned: found again, and left as they are?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, arg

from kpred.cli.command import Command
from kpred.cli.output import Output
from kpred.cli.summary_table import SummaryTable
from kpred.cli.usage import UsageError

if TYPE_CHECKING:
    from kpred.evaluation.metrics.summary import Summary


@dataclass(frozen=True, kw_only=True)
class CatalogueCommand(Command):
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
    output: Annotated[Path | None, arg(aliases=["-o"], metavar="FILE")] = None
    """Write rows, targets, and what they were made by, to this JSON file too"""
    picture: Annotated[Path | None, arg(metavar="FILE")] = None
    """Write a contact sheet of the worst results (.png)"""
    tiles: Annotated[int, arg(metavar="N")] = 18
    """How many results are on the contact sheet"""
    model: Annotated[str | None, arg(metavar="NAME_OR_PATH")] = None
    """Trained networks: a name or a folder; without it, the bundled ones"""
    database: Annotated[Path | None, arg(metavar="FILE")] = None
    """Search this database (.kpred); without it and without packs, the bundled one"""
    views: Annotated[int, arg(metavar="N")] = 1
    """Depth views of each model, taken together; 0: its whole surface"""
    top_k: Annotated[int, arg(metavar="K")] = 10
    """How many retrieved models are deformed and compared"""
    limit: Annotated[int, arg(metavar="N")] = 40
    """At most so many models a category, drawn at random by the seed; 0: all of them"""
    seed: Annotated[int, arg(metavar="SEED")] = 0
    """Of models, scans, sampling and intervals; the same arguments give the same rows, but for the times"""

    def run(self, output: Output) -> None:
        """Measure with a progress bar, print and write."""
        from kpred.atomic import check_place
        from kpred.cli.progress import ProgressBar
        from kpred.evaluation.metrics.summary import write_report
        from kpred.evaluation.scans.catalogue import CatalogueConfig, evaluate_catalogue
        from kpred.rendering.contact_sheet import check_picture, save_contact_sheet

        if self.tiles < 1:
            raise UsageError(f"--tiles must be at least 1, but is {self.tiles}")
        if self.output is not None:
            check_place(self.output)
        if self.picture is not None:
            check_picture(self.picture)
        tiles = 0 if self.picture is None else self.tiles
        config = CatalogueConfig(self.views, self.limit or None, self.seed, self.top_k, tiles)
        with ProgressBar() as bar:
            report = evaluate_catalogue(self.packs, self.model, self.database, config, progress=bar.update)
        if self.output is not None:
            write_report(self.output, report.to_json())
        if self.picture is not None:
            save_contact_sheet(report.tiles, self.picture)
        output.result(report.to_json())
        scanned = "whole surfaces" if self.views == 0 else f"{self.views} depth view{'s' if self.views > 1 else ''}"
        _print(output, report.summaries, scanned, self.top_k)
        for sentence in report.header["remarks"][:10]:
            output.note(f"note: {sentence}")
        for _, outcome in report.outcomes:
            if outcome.failure is not None:
                output.note(f"failed: {outcome.category} {outcome.model_id}: {outcome.failure}")
        for file in (self.output, self.picture):
            if file is not None:
                output.note(f"wrote {file}")


def _print(output: Output, summaries: Sequence[Summary], scanned: str, top_k: int) -> None:
    table, right = SummaryTable(summaries), "right model first"
    output.table(
        f"models of the database, scanned ({scanned}), up axis and category given; 95 % intervals",
        ["data", "n", "right model first", f"in {top_k}", "yaw < 15°", "distance %", "failed", "ms"],
        [
            (
                name,
                table.count(key, "right_model_first"),
                table.interval(key, "right_model_first"),
                table.interval(key, "right_model_in_top_k"),
                table.interval(key, "yaw_right"),
                _percent(table.value(key, "distance")),
                table.value(key, "failed"),
                table.value(key, "milliseconds"),
            )
            for name, key in table.lines("right_model_first")
        ],
    )
    output.table(
        "where the right model is first: distance from the true surface to result and undeformed model, % of the "
        "longest side, medians; thickness of boards / own, median; fraction of boards within 10 %; steps chosen",
        ["data", "n", "result", "undeformed", "ratio", "thickness", "kept", "yaw < 15°", "none", "scale", "structure"],
        [
            (
                name,
                table.count(key, "distance", right),
                _percent(table.value(key, "distance", right)),
                _percent(table.value(key, "undeformed_distance", right)),
                table.interval(key, "distance_ratio", right),
                table.interval(key, "board_thickness", right),
                table.value(key, "boards_kept", right),
                table.value(key, "yaw_right", right),
                *(table.value(key, f"step_{step}", right) for step in ("none", "scale", "structure")),
            )
            for name, key in table.lines("right_model_first")
        ],
    )


def _percent(fraction: float | None) -> float | None:
    return None if fraction is None else 100 * fraction
