"""`kpred demo`: the bundled scan, fitted with what is bundled."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar

from tyro.conf import arg

from kpred.cli.command import Command
from kpred.cli.output import Output


@dataclass(frozen=True, kw_only=True)
class DemoCommand(Command):
    """Fit the bundled sample scan with the bundled models, and write mesh, record and picture.

    examples:
      kpred demo
      kpred demo -o /some/folder --json
    """

    fits: ClassVar[bool] = True

    output: Annotated[Path, arg(aliases=["-o"], metavar="FOLDER")] = Path("kpred-demo")
    """Where to write; the folder is made"""
    picture: Annotated[bool, arg(help_behavior_hint="")] = True
    """Write no picture"""

    def run(self, output: Output) -> None:
        """Fit, write the files, print what was chosen."""
        from kpred.cli.fit_files import describe
        from kpred.errors import OutputError
        from kpred.fitting import sample_scan
        from kpred.fitting.pipeline import fit
        from kpred.reports.fit_files import write_files
        from kpred.shapes import read_scan

        try:
            self.output.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise OutputError(f"Cannot make the folder {self.output}: {error.strerror}; choose another.") from error
        scan_path = sample_scan()
        scan = read_scan(scan_path)
        output.note(f"scan: {scan_path.name}, {len(scan)} points")
        result = fit(scan_path)
        mesh_file = self.output / f"{scan_path.stem}.obj"
        written = write_files(result, scan, mesh_file, scan_path=scan_path, picture=self.picture)
        describe(output, written.record, written.files)


COMMAND: type[Command] = DemoCommand
