"""`kpred evaluate real`: crops of real scans, and the objects of annotated Scan2CAD scenes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from tyro.conf import arg

from kpred.cli.command import Command
from kpred.cli.output import Output
from kpred.cli.usage import UsageError

if TYPE_CHECKING:
    from kpred.evaluation.scans.real_crops import CropOutcome
    from kpred.evaluation.scans.scenes import SceneOutcome


@dataclass(frozen=True, kw_only=True)
class RealCommand(Command):
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
    output: Annotated[Path | None, arg(aliases=["-o"], metavar="FILE")] = None
    """Write rows, targets, and what they were made by, to this JSON file too"""
    picture: Annotated[Path | None, arg(metavar="FILE")] = None
    """Write a contact sheet of all scans beside their results (.png)"""
    model: Annotated[str | None, arg(metavar="NAME_OR_PATH")] = None
    """Trained networks: a name or a folder; without it, the bundled ones"""
    database: Annotated[Path | None, arg(metavar="FILE")] = None
    """CAD database (.kpred); without it, the bundled one"""
    top_k: Annotated[int, arg(metavar="K")] = 10
    """How many retrieved models are deformed and compared"""
    seed: Annotated[int, arg(metavar="SEED")] = 0
    """Of sampling and intervals"""

    def run(self, output: Output) -> None:
        """Measure with a progress bar, print and write."""
        from kpred.atomic import check_place
        from kpred.cli.progress import ProgressBar
        from kpred.evaluation.header import made_by, versions
        from kpred.evaluation.metrics.summary import write_report
        from kpred.evaluation.scans.outcomes import Fitting
        from kpred.evaluation.scans.real_crops import evaluate_crops, read_crops, summarise_crops
        from kpred.evaluation.scans.scenes import evaluate_scenes, summarise_scenes
        from kpred.fitting.defaults import resolve_database, resolve_model
        from kpred.rendering.contact_sheet import check_picture, save_contact_sheet

        if self.annotations is not None and self.scene is None:
            raise UsageError("--annotations says what stands in a scene; give --scene FOLDER too")
        if self.crops is None and self.scene is None:
            raise UsageError("no scans were named; try `kpred evaluate real --crops FOLDER` or `--scene FOLDER`")
        if self.output is not None:
            check_place(self.output)
        if self.picture is not None:
            check_picture(self.picture)
        model, database = resolve_model(self.model), resolve_database(self.database)
        how = Fitting(model, database, self.top_k, self.seed)
        remarks: list[str] = []
        crops: list[CropOutcome] = []
        objects: list[SceneOutcome] = []
        rows = []
        with ProgressBar() as bar:
            if self.crops is not None:
                finds_up = self.up == "auto"
                found = read_crops(self.crops, None if finds_up else self.up)
                crops = evaluate_crops(found, how, find_up=finds_up, progress=bar.update, report=remarks.append)
                rows += summarise_crops(crops, self.crops.resolve().name, self.seed)
            if self.scene is not None:
                objects = evaluate_scenes(self.scene, how, self.annotations, progress=bar.update, report=remarks.append)
                rows += summarise_scenes(objects, self.scene.resolve().name, self.seed)
        report: dict[str, Any] = {
            "header": {
                **made_by(model),
                "database": str(database.path),
                "top_k": self.top_k,
                "seed": self.seed,
                "up": "found by the fit" if self.up == "auto" else "given",
                "remarks": remarks,
                "versions": versions(),
            },
            "rows": [row.to_json() for row in rows],
            "crops": [outcome.to_json() for outcome in crops],
            "objects": [outcome.to_json() for outcome in objects],
        }
        if self.output is not None:
            write_report(self.output, report)
        if self.picture is not None:
            shown: list[CropOutcome | SceneOutcome] = [*crops, *objects]
            tiles = [outcome.tile for outcome in shown if outcome.tile is not None]
            save_contact_sheet(tiles, self.picture)
        output.result(report)
        if crops:
            _print_crops(output, crops)
        if objects:
            _print_objects(output, objects)
        for sentence in remarks:
            output.note(f"note: {sentence}")
        for file in (self.output, self.picture):
            if file is not None:
                output.note(f"wrote {file}")


def _print_crops(output: Output, crops: Sequence[CropOutcome]) -> None:
    output.table(
        f"crops, {_given(crops)}; mean distance of points to the result's surface, cm, scan's frame; tilt of facets "
        "along the axes, degrees; flatness, % of the longest side",
        ["crop", "found", "model", "step", "kept", "all", "tilt °", "flat %", "confidence", "warnings", "ms", ""],
        [
            (
                crop.file,
                crop.found,
                crop.model,
                crop.step,
                _centimetres(crop.distance_kept),
                _centimetres(crop.distance_all),
                None if crop.cleanliness is None else round(crop.cleanliness.axis_tilt, 4),
                None if crop.cleanliness is None else round(100 * crop.cleanliness.flatness, 4),
                crop.confidence,
                crop.warnings,
                None if crop.milliseconds is None else round(crop.milliseconds),
                "failed" if crop.failure else "" if crop.near and crop.category_right else "wrong",
            )
            for crop in crops
        ],
    )
    n = len(crops)
    output.note(
        f"{sum(crop.near for crop in crops)} of {n} under 4 cm (kept points; all points: "
        f"{sum(crop.all_near for crop in crops)} of {n}); {sum(crop.category_right for crop in crops)} of {n} of the "
        "right category"
    )
    if any(crop.up_right is not None for crop in crops):
        output.note(f"{sum(crop.up_right is True for crop in crops)} of {n} with the right up axis")
    clean = [crop.cleanliness for crop in crops if crop.cleanliness is not None]
    if clean:
        tilt, flat = (sum(getattr(one, name) for one in clean) / len(clean) for name in ("axis_tilt", "flatness"))
        output.note(f"mean over {len(clean)} results: facets tilt by {tilt:.2g} degrees, flat to {100 * flat:.2g} %")
    for crop in crops:
        if crop.failure is not None:
            output.note(f"failed: {crop.file}: {crop.failure}")


def _given(crops: Sequence[CropOutcome]) -> str:
    finds_up = any(crop.up_right is not None for crop in crops)
    return "nothing given" if finds_up else "nothing given but the up axis"


def _print_objects(output: Output, objects: Sequence[SceneOutcome]) -> None:
    output.table(
        "annotated objects; mean distance of their points to result and annotated CAD model, cm, scan's frame",
        [
            "object",
            "found untold",
            "model",
            "result",
            "annotated",
            "ratio",
            "centre",
            "yaw °",
            "confidence",
            "ms",
            "",
        ],
        [
            (
                f"{item.scene} {item.name}",
                item.found,
                item.model,
                _centimetres(item.distance),
                _centimetres(item.annotated_distance),
                item.ratio,
                item.centre_cm,
                item.yaw,
                item.confidence,
                None if item.milliseconds is None else round(item.milliseconds),
                "failed" if item.failure else "" if item.passes else "fails",
            )
            for item in objects
        ],
    )
    passed = sum(item.passes for item in objects)
    output.note(f"{passed} of {len(objects)} pass: ratio at most 1.2 and centre within 10 cm")
    for item in objects:
        if item.failure is not None:
            output.note(f"failed: {item.scene} {item.name}: {item.failure}")


def _centimetres(metres: float | None) -> float | None:
    return None if metres is None else 100 * metres
