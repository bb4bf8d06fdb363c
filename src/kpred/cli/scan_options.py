"""Options that the commands of whole fits share: networks, database, files; and how they write and print."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from tyro.conf import arg

from kpred.cli.command import NetworkCommand
from kpred.cli.output import Output
from kpred.cli.table_options import print_pages, print_written

if TYPE_CHECKING:
    from kpred.evaluation.page import Page
    from kpred.rendering.contact_sheet import Tile


@dataclass(frozen=True, kw_only=True)
class MeasuredFitsCommand(NetworkCommand):
    """Measurements of whole fits."""

    output: Annotated[Path | None, arg(aliases=["-o"], metavar="FILE")] = None
    """Write rows, targets, and what they were made by, to this JSON file too"""
    picture: Annotated[Path | None, arg(metavar="FILE")] = None
    """Write a contact sheet of scans beside their results (.png)"""
    database: Annotated[Path | None, arg(metavar="FILE")] = None
    """Search this database (.kpred); without it, one built from the split `source` of the packs, or the bundled one"""
    top_k: Annotated[int, arg(metavar="K")] = 10
    """How many retrieved models are deformed and compared"""
    seed: Annotated[int, arg(metavar="SEED")] = 0
    """Of scans, sampling and intervals; the same arguments give the same rows, but for the times"""

    def check(self) -> None:
        """Refuse what cannot work before any work is done."""
        from kpred.atomic import check_place
        from kpred.rendering.contact_sheet import check_picture

        if self.output is not None:
            check_place(self.output)
        if self.picture is not None:
            check_picture(self.picture)

    def finish(
        self,
        output: Output,
        report: dict[str, Any],
        tiles: Sequence[Tile],
        pages: Iterable[Page],
        notes: Iterable[str],
    ) -> None:
        """Write and print a report, its pictures, and notes."""
        from kpred.json_output import write_json
        from kpred.rendering.contact_sheet import save_contact_sheet

        if self.output is not None:
            write_json(self.output, report)
        if self.picture is not None:
            save_contact_sheet(tiles, self.picture)
        output.result(report)
        print_pages(output, pages)
        for sentence in notes:
            output.note(sentence)
        print_written(output, (self.output, self.picture))
