"""`kpred studio`: a page in the browser to look at a fit and to correct it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from tyro.conf import Positional, arg

from kpred.cli.command import Command, FitsCommand
from kpred.cli.output import Output
from kpred.cli.usage import UsageError
from kpred.refinement.config import Deform
from kpred.shapes.unit_name import UnitName

if TYPE_CHECKING:
    from kpred.fitting.stages import Context
    from kpred.studio.opening import Opened
    from kpred.studio.room import RoomSession
    from kpred.studio.tabs import Tab


@dataclass(frozen=True, kw_only=True)
class StudioCommand(FitsCommand):
    """Open a page in the browser to look at a fit and to correct it by hand.

    Of a raw room, all furniture is fitted first, as `kpred scene` does; an object that is clicked is corrected as a
    scan is. Needs the extra: pip install 'kpred[studio]'. The page is served on this machine alone, until Ctrl-C.

    examples:
      kpred studio chair.ply
      kpred studio scan.pcd --up z --database mine.kpred
      kpred studio chair.json
      kpred studio chair.studio.json --scan chair.ply
      kpred studio chair.studio.json -o chair.obj
      kpred studio room.ply --up z
      kpred studio room.studio.json -o room.glb
    """

    opened: Annotated[Positional[Path | None], arg(metavar="SCAN_ROOM_OR_RECORD")] = None
    """A scan, a room, or the record (.json) of a session or a fit; without it, the bundled sample scan"""
    kind: Literal["auto", "object", "room"] = "auto"
    """What the scan shows: one object, or a room; auto finds out"""
    objects: Annotated[Path | None, arg(metavar="FILE")] = None
    """What names the objects of a room, as for kpred scene; without it, they are found"""
    scan: Annotated[Path | None, arg(metavar="FILE")] = None
    """Scan or room of a record; without it, the file of its name beside the record"""
    output: Annotated[Path | None, arg(aliases=["-o"], metavar="OUT")] = None
    """Write the result of a record to this file, and open no page"""
    category: Annotated[str | None, arg(metavar="NAME")] = None
    """chair, table, cabinet, ...; without it, the category that fits best"""
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

        self._check()
        if self.output is None:
            # Before the work: a port in use is known at once.
            free_port(self.host, self.port)
        context = Context.load(self.model, self.database, self.category)
        if self._is_room(context):
            self._run_room(self._open_room(context), output)
        else:
            self._run_object(self._open(context), output)

    def _is_room(self, context: Context) -> bool:
        from kpred.fitting.options import FitOptions
        from kpred.studio.record import is_fit_record, is_record
        from kpred.studio.room_opening import is_plainly_room
        from kpred.studio.room_record import is_room_record

        if self.opened is not None and is_record(self.opened):
            return not is_fit_record(self.opened) and is_room_record(self.opened)
        if self.kind == "object" or self.opened is None:
            return False
        if self.kind == "room" or self.objects is not None:
            return True
        return is_plainly_room(self.opened, context, FitOptions(up=self.up, unit=self.unit))

    def _open(self, context: Context) -> Opened:
        from kpred.fitting.defaults import sample_scan
        from kpred.fitting.options import FitOptions
        from kpred.studio.opening import open_fit_record, open_record, open_scan
        from kpred.studio.record import is_fit_record, is_record

        if self.opened is not None and is_record(self.opened):
            if is_fit_record(self.opened):
                return open_fit_record(self.opened, self.scan, context)
            return open_record(self.opened, self.scan, context)
        options = FitOptions(up=self.up, deform=self.deform, unit=self.unit)
        return open_scan(sample_scan() if self.opened is None else self.opened, context, options)

    def _open_room(self, context: Context) -> RoomSession:
        from kpred.cli.progress import ProgressBar
        from kpred.studio.record import is_record
        from kpred.studio.room_opening import RoomFiles, RoomOptions, open_room, open_room_record

        assert self.opened is not None
        if self.category is not None:
            raise UsageError("--category is that of one object; leave it out for a room, or give --kind object.")
        with ProgressBar() as bar:
            if is_record(self.opened):
                files = None if self.scan is None else RoomFiles(self.scan, self.objects)
                return open_room_record(
                    self.opened, files, context, lambda done, total, name: bar.update("objects", done, total, name)
                )
            options = RoomOptions(self.up, self.deform, self.unit)
            return open_room(
                RoomFiles(self.opened, self.objects),
                context,
                options,
                lambda done, total, name: bar.update("objects", done, total, name),
            )

    def _check(self) -> None:
        """Refuse options that contradict each other."""
        from kpred.studio.record import is_record

        if self.opened is not None and is_record(self.opened):
            if (self.up, self.deform, self.unit, self.category) != ("auto", "auto", "auto", None):
                raise UsageError("The record holds category, up axis, deform mode and unit; leave out these options.")
            return
        if self.scan is not None or self.output is not None:
            raise UsageError(
                "--scan and --output belong to the record of a session; use kpred fit for a scan, and kpred scene for "
                "a room."
            )
        if self.kind == "object" and self.objects is not None:
            raise UsageError("--objects names the objects of a room; it says nothing of one object.")

    def _run_object(self, opened: Opened, output: Output) -> None:
        from kpred.studio.session import Session
        from kpred.studio.tabs import scan_tabs

        if self.output is None:
            self._serve(scan_tabs(opened), opened.name, output)
            return
        state = Session.replay(opened.start, opened.gestures).state
        files = state.result.save(self.output)
        output.result({**state.result.to_json(), "files": files})
        output.note("\n".join(f"wrote {file}" for file in files))

    def _run_room(self, room: RoomSession, output: Output) -> None:
        from kpred.studio.tabs import room_tabs

        if self.output is None:
            self._serve(room_tabs(room), room.name, output)
            return
        result = room.result()
        result.to_glb(self.output)
        output.result({**result.to_json(self.output.name), "files": [self.output]})
        output.note(f"wrote {self.output}")

    def _serve(self, make_tab: Callable[[Any], Tab], name: str, output: Output) -> None:
        import webbrowser

        from kpred.studio.serve import Studio

        studio = Studio(make_tab, self.host, self.port)
        output.note(f"kpred studio shows {name} at {studio.url} (Ctrl-C ends it)")
        try:
            if self.browser:
                webbrowser.open(studio.url)
            studio.wait()
        finally:
            studio.stop()


COMMAND: type[Command] = StudioCommand
