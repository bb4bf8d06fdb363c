"""`kpred refit`: a fit made again from its record."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from kpred.cli.command import Command
from kpred.cli.output import Output


@dataclass(frozen=True, kw_only=True)
class RefitCommand(Command):
    """Make a fit again from its record, to the bit.

    The record names scan, database, weights and all options. It is an error, and nothing is written, if one of them has
    changed since.

    examples:
      kpred refit chair.json
      kpred refit chair.json -o again.glb
      kpred refit chair.studio.json -o chair.obj
      kpred refit chair.json --scan moved/scan.ply --database moved/mine.kpred
    """

    record: Annotated[Positional[Path], arg(metavar="RECORD")]
    """Record (.json) that kpred fit, fit-many or studio wrote"""
    output: Annotated[Path | None, arg(aliases=["-o"], metavar="OUT")] = None
    """The file to write, by extension as of kpred fit; without it, RECORD_refit with the extension of the mesh"""
    scan: Annotated[Path | None, arg(metavar="FILE")] = None
    """Where the scan is now; without it, where the record says, or beside the record"""
    model: Annotated[str | None, arg(metavar="NAME_OR_PATH")] = None
    """Where the weights are now; without it, where the record says"""
    database: Annotated[Path | None, arg(metavar="FILE")] = None
    """Where the database is now; without it, where the record says"""
    inexact: Annotated[bool, arg(help_behavior_hint="")] = False
    """Write the result also if its mesh is not the record's to the bit, as with other versions of libraries"""
    picture: Annotated[bool, arg(help_behavior_hint="")] = True
    """Write no picture"""
    overwrite: Annotated[bool, arg(help_behavior_hint="")] = False
    """Replace files beside OUT (record, picture) that kpred did not make"""

    def run(self, output: Output) -> None:
        """Fit again, write the files, print what was chosen."""
        if self._is_of_studio():
            self._replay(output)
            return
        from kpred.cli.fit_files import check_output, describe
        from kpred.fitting.refit import read_record, refit
        from kpred.reports.fit_files import write_files
        from kpred.shapes import read_scan

        record = read_record(self.record)
        scan_path = record.scan if self.scan is None else self.scan
        suffix = Path(str(record.content.get("mesh") or "a.glb")).suffix or ".glb"
        target = self.output or self.record.with_name(f"{self.record.stem}_refit{suffix}")
        check_output(target, scan_path, self.overwrite, self.picture)
        result = refit(record, scan_path, self.model, self.database, exact=not self.inexact)
        scan = read_scan(scan_path)
        written = write_files(result, scan, target, scan_path=scan_path, picture=self.picture)
        describe(output, written.record, written.files)

    def _is_of_studio(self) -> bool:
        """Find out whether the record is that of a session of studio, of a scan or of a room."""
        from kpred.errors import ConfigError
        from kpred.studio.record import read_content

        try:
            read_content(self.record)
        except ConfigError:
            return False
        return True

    def _replay(self, output: Output) -> None:
        """Repeat the gestures of a session."""
        from kpred.cli.studio import StudioCommand

        stem = self.record.stem.removesuffix(".studio")
        target = self.output or self.record.with_name(f"{stem}_refit.glb")
        StudioCommand(
            opened=self.record, scan=self.scan, output=target, model=self.model, database=self.database
        ).run(output)  # fmt: skip


COMMAND: type[Command] = RefitCommand
