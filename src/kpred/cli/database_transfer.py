"""`kpred database copy` and `update`: a whole database into another place, or into the format of this version."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from tyro.conf import Positional, arg

from kpred.cli.command import Command
from kpred.cli.output import Output
from kpred.cli.usage import UsageError
from kpred.database.address import masked


@dataclass(frozen=True, kw_only=True)
class CopyCommand(Command):
    """Copy a database into another, from a file to a server or back, and compare the two.

    A copy that was stopped goes on where it was when the same command is given again. Models that only TARGET has stay.

    examples:
      kpred database copy mine.kpred postgresql://me@host/models
      kpred database copy postgresql://me@host/models mine.kpred
    """

    source: Annotated[Positional[str], arg(metavar="SOURCE")]
    """An existing database: a file or postgresql://user@host/name"""
    target: Annotated[Positional[str], arg(metavar="TARGET")]
    """Where to copy it; made where there is none"""
    batch: Annotated[int, arg(metavar="N")] = 64
    """Models copied in one transaction"""

    def run(self, output: Output) -> None:
        """Copy, compare, and print the numbers."""
        from kpred.cli.progress import ProgressBar
        from kpred.database import copy_database

        if self.batch < 1:
            raise UsageError("--batch must be at least 1.")
        with ProgressBar() as bar:
            report = copy_database(self.source, self.target, batch=self.batch, progress=bar.update)
        output.result({"source": masked(self.source), "target": masked(self.target), **report.__dict__})
        output.note(f"{report.copied} copied, {report.present} already there, all {report.verified} are the same")


@dataclass(frozen=True, kw_only=True)
class UpdateCommand(Command):
    """Update a database of an older kpred: compute what is missing; other data stays identical.

    An update that was stopped leaves the database as it was.

    examples:
      kpred database update mine.kpred
      kpred database update postgresql://me@host/models
    """

    file: Annotated[Positional[str], arg(metavar="DATABASE")]
    """An existing database: a file or postgresql://user@host/name"""

    def run(self, output: Output) -> None:
        """Update and print the number of models."""
        from kpred.cli.progress import ProgressBar
        from kpred.database import update_database

        with ProgressBar() as bar:
            updated = update_database(
                self.file, progress=lambda done, total: bar.update("computing structures", done, total)
            )
        place = masked(self.file)
        output.result({"path": place, "updated": updated})
        output.note(f"{place}: {updated} models updated" if updated else f"{place} is up to date")
