"""`kpred evaluate real`: crops of real scans, and the objects of annotated Scan2CAD scenes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from tyro.conf import arg

from kpred.cli.output import Output
from kpred.cli.scan_options import MeasuredFitsCommand
from kpred.cli.usage import UsageError

if TYPE_CHECKING:
    from kpred.evaluation.page import Page
    from kpred.evaluation.scans.real import RealReport


@dataclass(frozen=True, kw_only=True)
class RealCommand(MeasuredFitsCommand):
    """Measure fits of real scans: crops of single objects, and the objects of Scan2CAD scenes.

    Crops are fitted with nothing given but the up axis (--up auto: nothing at all): how near do their points lie to the
    result's surface, is it of the right category, and is it clean? Objects of a scene are fitted as `kpred scene` fits
    them and compared with the annotated CAD model in its annotated pose; an object passes if it is at most 1.2 times as
    far from the object's points, and its centre within 10 cm.

    examples:
      kpred evaluate real --crops crops/ --picture crops.png
      kpred evaluate real --crops crops/ --up auto
      kpred evaluate real --scene Scan2CAD/ -o rows.json --json
      kpred evaluate real --scene Scan2CAD/ --annotations full_annotations.json --database mine.kpred
    """

    crops: Annotated[Path | None, arg(metavar="FOLDER")] = None
    """<category>_<nn>.ply in metres, y up; an index.json beside them may say file, category and up of each"""
    up: Annotated[Literal["x", "y", "z", "-x", "-y", "-z", "auto"] | None, arg(metavar="AXIS")] = None
    """Up axis of all crops, whatever their index says; auto: the fit must find it"""
    scene: Annotated[Path | None, arg(metavar="FOLDER")] = None
    """Laid out as Scan2CAD's repository: full_annotations.json, Assets/scannet-sample, Assets/shapenet-sample"""
    annotations: Annotated[Path | None, arg(metavar="FILE")] = None
    """Scan2CAD's annotations; without it, full_annotations.json in the scene's folder"""

    def run(self, output: Output) -> None:
        """Measure with a progress bar, print and write."""
        from kpred.cli.progress import ProgressBar
        from kpred.evaluation.scans.outcome import FitSettings
        from kpred.evaluation.scans.real import RealConfig, evaluate_real
        from kpred.fitting.defaults import resolve_database, resolve_model

        if self.annotations is not None and self.scene is None:
            raise UsageError("--annotations says what stands in a scene; give --scene FOLDER too")
        if self.crops is None and self.scene is None:
            raise UsageError("no scans were named; try `kpred evaluate real --crops FOLDER` or `--scene FOLDER`")
        self.check()
        settings = FitSettings(resolve_model(self.model), resolve_database(self.database), self.top_k, self.seed)
        config = RealConfig(self.crops, self.up, self.scene, self.annotations)
        with ProgressBar() as bar:
            report = evaluate_real(config, settings, bar.update)
        self.finish(output, report.to_json(), report.tiles, _pages(report), _notes(report))


def _pages(report: RealReport) -> Iterator[Page]:
    from kpred.evaluation.scans.real_pages import crop_page, object_page

    if report.crops:
        yield crop_page(report.crops)
    if report.objects:
        yield object_page(report.objects)


def _notes(report: RealReport) -> Iterator[str]:
    from kpred.evaluation.scans.real_pages import crop_notes, object_notes

    if report.crops:
        yield from crop_notes(report.crops)
    if report.objects:
        yield from object_notes(report.objects)
    yield from (f"note: {sentence}" for sentence in report.header["remarks"])
