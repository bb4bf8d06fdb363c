"""`kpred studio`: a page in the browser to look at a fit and to correct it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from tyro.conf import Positional, arg

from kpred.cli.command import Command
from kpred.cli.output import Output
from kpred.cli.usage import UsageError
from kpred.refinement.config import Deform
from kpred.shapes.unit import UnitName

if TYPE_CHECKING:
    from kpred.fitting.stages import Context
    from kpred.studio.opening import Opened


@dataclass(frozen=True, kw_only=True)
class StudioCommand(Command):
    """Open a page in the browser to look at a fit and to correct it by hand.

    Needs the extra: pip install 'kpred[studio]'. The page is served on this machine alone, until Ctrl-C.

    examples:
      kpred studio chair.ply
      kpred studio scan.pcd --up z --database mine.kpred
      kpred studio chair.studio.json --scan chair.ply
      kpred studio chair.studio.json -o chair.obj
    """

    opened: Annotated[Positional[Path | None], arg(metavar="SCAN_OR_RECORD")] = None
    """A scan, or the record (.json) of a session; without it, the bundled sample scan"""
    scan: Annotated[Path | None, arg(metavar="FILE")] = None
    """Scan of a record; without it, the file of its name beside the record"""
    output: Annotated[Path | None, arg(aliases=["-o"], metavar="OUT")] = None
    """Write the result of a record to this file, and open no page"""
    category: Annotated[str | None, arg(metavar="NAME")] = None
    """chair, table, cabinet, ...; without it, the category that fits best"""
    model: Annotated[str | None, arg(metavar="NAME_OR_PATH")] = None
    """Trained networks: a name or a folder; without it, the bundled ones"""
    database: Annotated[Path | None, arg(metavar="FILE")] = None
    """CAD database (.kpred); without it, the bundled one"""
    up: Literal["auto", "x", "y", "z", "-x", "-y", "-z"] = "auto"
    """Up axis of the scan; auto finds it"""
    deform: Deform = "auto"
    """How far a model may be changed, as for kpred fit"""
    unit: UnitName | Literal["auto"] = "auto"
    """Unit of the scan's lengths; auto guesses it from the object's size"""
    host: Annotated[str, arg(metavar="ADDRESS")] = "127.0.0.1"
    """Address to serve at; any other than this one lets others on the network see the scan"""
    port: Annotated[int, arg(metavar="N")] = 8080
    """Port to serve at; 0 is any free one"""
    browser: Annotated[bool, arg(help_behavior_hint="")] = True
    """Open no browser"""

    def run(self, output: Output) -> None:
        """Fit, serve the page, and wait for Ctrl-C."""
        from kpred.fitting.stages import Context
        from kpred.studio.server import free_port

        if self.output is None:
            # Before the work: a port in use is known at once.
            free_port(self.host, self.port)
        context = Context.load(self.model, self.database, self.category)
        opened = self._open(context)
        if self.output is not None:
            self._write(opened, self.output, output)
            return
        self._serve(opened, output)

    def _open(self, context: Context) -> Opened:
        from kpred.fitting.defaults import sample_scan
        from kpred.fitting.options import FitOptions
        from kpred.studio.opening import open_record, open_scan
        from kpred.studio.record import is_record

        if self.opened is not None and is_record(self.opened):
            if (self.up, self.deform, self.unit, self.category) != ("auto", "auto", "auto", None):
                raise UsageError("The record holds category, up axis, deform mode and unit; leave out these options.")
            return open_record(self.opened, self.scan, context)
        if self.scan is not None or self.output is not None:
            raise UsageError("--scan and --output belong to the record of a session; use kpred fit for a scan.")
        options = FitOptions(up=self.up, deform=self.deform, unit=self.unit)
        return open_scan(sample_scan() if self.opened is None else self.opened, context, options)

    def _write(self, opened: Opened, path: Path, output: Output) -> None:
        from kpred.studio.session import Session

        state = Session.replay(opened.start, opened.gestures).state
        files = state.result.save(path)
        output.result({**state.result.to_json(), "files": files})
        output.note("\n".join(f"wrote {file}" for file in files))

    def _serve(self, opened: Opened, output: Output) -> None:
        import webbrowser

        from kpred.studio.serve import Studio

        studio = Studio(opened.start, opened.name, opened.gestures, self.host, self.port)
        output.note(f"kpred studio shows {opened.name} at {studio.url} (Ctrl-C ends it)")
        try:
            if self.browser:
                webbrowser.open(studio.url)
            studio.wait()
        finally:
            studio.stop()


COMMAND: type[Command] = StudioCommand
