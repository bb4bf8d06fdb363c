"""`kpred evaluate scans`: virtual scans with nothing given but gravity, against the same with everything given."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, arg

from kpred.cli.command import Command
from kpred.cli.output import Output
from kpred.cli.summary_table import SummaryTable
from kpred.cli.usage import UsageError

if TYPE_CHECKING:
    from kpred.evaluation.metrics.reliability import Reliability
    from kpred.evaluation.scans.virtual_scans import ScansReport


@dataclass(frozen=True, kw_only=True)
class ScansCommand(Command):
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
    output: Annotated[Path | None, arg(aliases=["-o"], metavar="FILE")] = None
    """Write rows, targets, and what they were made by, to this JSON file too"""
    picture: Annotated[Path | None, arg(metavar="FILE")] = None
    """Write a contact sheet of the worst and of some typical targets (.png)"""
    worst: Annotated[int, arg(metavar="N")] = 12
    """How many of the worst targets are on the contact sheet, and half as many typical ones"""
    model: Annotated[str | None, arg(metavar="NAME_OR_PATH")] = None
    """Trained networks: a name or a folder; without it, the bundled ones"""
    database: Annotated[Path | None, arg(metavar="FILE")] = None
    """Search this database (.kpred); without it, one built from the split `source` of all packs of a folder"""
    split: Annotated[str, arg(metavar="NAME")] = "val"
    """Whose shapes are the targets"""
    top_k: Annotated[int, arg(metavar="K")] = 10
    """How many retrieved models are deformed and compared"""
    limit: Annotated[int, arg(metavar="N")] = 40
    """At most so many targets a pack, drawn at random by the seed; 0: all of them"""
    seed: Annotated[int, arg(metavar="SEED")] = 0
    """Of targets, scans, sampling and intervals; the same arguments give the same rows, but for the times"""

    def run(self, output: Output) -> None:
        """Measure with a progress bar, print and write."""
        from kpred.atomic import check_place
        from kpred.cli.progress import ProgressBar
        from kpred.evaluation.metrics.summary import write_report
        from kpred.evaluation.scans.virtual_scans import evaluate_scans
        from kpred.rendering.contact_sheet import check_picture, save_contact_sheet

        if not self.packs:
            raise UsageError("no pack was named; try `kpred evaluate scans FILE.npz`")
        if self.worst < 1:
            raise UsageError(f"--worst must be at least 1, but is {self.worst}")
        if self.output is not None:
            check_place(self.output)
        if self.picture is not None:
            check_picture(self.picture)
        with ProgressBar() as bar:
            report = evaluate_scans(
                self.packs,
                self.model,
                self.database,
                split=self.split,
                limit=self.limit or None,
                seed=self.seed,
                top_k=self.top_k,
                worst=0 if self.picture is None else self.worst,
                progress=bar.update,
                # They are in the header, and printed with the tables.
                report=lambda sentence: None,
            )
        written = [file for file in (self.output, self.picture) if file is not None]
        if self.output is not None:
            write_report(self.output, report.to_json())
        if self.picture is not None:
            save_contact_sheet(report.tiles, self.picture)
        output.result(report.to_json())
        _print(output, report)
        for file in written:
            output.note(f"wrote {file}")


def _print(output: Output, report: ScansReport) -> None:
    table = SummaryTable(report.summaries)
    output.table(
        "nothing given but gravity (unknown), against frame, pose and category given (known); UCD from the whole true "
        "surface, unit box squared, true unit box; 95 % intervals",
        ["data", "n", "unknown", "known", "ratio", "yaw < 15°", "category", "right", "failed", "ms"],
        [
            (
                name,
                table.count(key, "category_right"),
                table.value(key, "ucd_whole_unknown"),
                table.value(key, "ucd_whole_known"),
                table.interval(key, "ucd_whole_ratio"),
                table.interval(key, "yaw_right"),
                table.interval(key, "category_right"),
                table.interval(key, "right"),
                table.value(key, "failed"),
                table.value(key, "milliseconds"),
            )
            for name, key in table.lines("category_right")
        ],
    )
    output.table(
        "errors: UCD from what the camera saw, unit box squared; box errors, share of the longest side; yaw, degrees, "
        "and share under 15 by symmetry",
        ["data", "seen, unknown", "seen, known", "ratio", "centre", "size", "yaw", "none", "half", "quarter", "round"],
        [
            (
                name,
                table.value(key, "ucd_visible_unknown"),
                table.value(key, "ucd_visible_known"),
                table.value(key, "ucd_visible_ratio"),
                table.value(key, "centre_error"),
                table.value(key, "size_error"),
                table.value(key, "yaw_error"),
                *(
                    table.counted(key, "yaw_right", f"symmetry {symmetry}")
                    for symmetry in ("none", "half turn", "quarter turn", "round")
                ),
            )
            for name, key in table.lines("category_right")
        ],
    )
    others = table.lines("other_warned")
    if others:
        output.table(
            "things of no known category: shares",
            ["data", "n", "confidence < 0.5", "warned", "neither", "refused", "ms"],
            [
                (
                    name,
                    table.count(key, "other_warned"),
                    *(table.value(key, f"other_{metric}") for metric in ("doubted", "warned", "unnoticed", "refused")),
                    table.value(key, "other_milliseconds"),
                )
                for name, key in others
            ],
        )
    found = sorted({name for counts in report.confusion.values() for name in counts})
    output.table(
        "category found (columns) of the true category (rows)",
        ["", *found],
        [(true, *(counts.get(name, 0) for name in found)) for true, counts in report.confusion.items()],
    )
    if report.reliability is not None:
        print_reliability(output, report.reliability)
    for sentence in (*report.header["remarks"], *report.failures)[:20]:
        output.note(f"note: {sentence}")
    if len(report.failures) > 20:
        output.note(f"note: and more; {len(report.failures)} fits failed in all")


def print_reliability(output: Output, found: Reliability) -> None:
    """Return the bins as a table, ECE and AUC in its title."""
    auc = "" if found.auc is None else f", area under ROC {found.auc:.3f}"
    output.table(
        f"confidence of {found.n} results against what is right: expected calibration error {found.ece:.3f}{auc}",
        ["confidence", "mean", "share right", "n"],
        [(f"{part.low:.1f} to {part.high:.1f}", part.confidence, part.right, part.n) for part in found.bins],
    )
