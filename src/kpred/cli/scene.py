"""`kpred scene`: every object of a scanned scene fitted, and one GLB of all."""

from __future__ import annotations

import shutil
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from tyro.conf import Positional, arg

from kpred.cli.command import Command, FitsCommand
from kpred.cli.output import Output
from kpred.refinement.config import Deform
from kpred.shapes.unit_name import UnitName

if TYPE_CHECKING:
    from kpred.fitting.fit_scene import SceneFit
    from kpred.fitting.object_fit import ObjectFit
    from kpred.scenes.scan2cad import AlignedModel


@dataclass(frozen=True, kw_only=True)
class SceneCommand(FitsCommand):
    """Fit a CAD model to every object of a scanned scene.

    Without --objects, and without instance numbers in the scene's file, the chairs, tables and cabinets of the raw scan
    are found, in any orientation. The result is one GLB, y up, with a node for each object. Beside it lie a record
    (.json), the alignments as Scan2CAD annotates them (_scan2cad.json) and benchmarks them (<scene>.csv), and a picture
    (.png). Scan2CAD's benchmark counts models outside of its own pool as wrong: `--pool` writes the pool's model whose
    proportions are nearest. Objects of categories that the model does not know are skipped; one that fails does not
    stop the others.

    examples:
      kpred scene room.ply
      kpred scene room.ply -o room.glb
      kpred scene room.ply -o room.glb --report room.html
      kpred scene scene0470_00_vh_clean_2.ply --objects full_annotations.json -o scene.glb
      kpred scene scene0470_00_vh_clean_2.ply --objects scene0470_00.aggregation.json -o scene.glb
      kpred scene room.ply --objects boxes.json -o room.glb --up y --no-picture
      kpred scene room.ply --objects instances.npy -o room.glb --json
      kpred scene office.ply --objects chairs.json -o office.glb --model-id chair_0042 --deform none
    """

    fits: ClassVar[bool] = True

    scene: Annotated[Positional[Path], arg(metavar="SCENE")]
    """Scanned scene, cloud or mesh: .ply (ScanNet, S3DIS, any), .pcd .txt .xyz .npy .npz .obj .glb ..."""
    objects: Annotated[Path | None, arg(metavar="FILE")] = None
    """Instance numbers (.npy .npz .txt .ply), ScanNet aggregation or boxes (.json), Scan2CAD full_annotations.json, or
    an S3DIS Annotations folder; without it, the instance numbers in the scene's own PLY, or else what is found"""
    output: Annotated[Path | None, arg(aliases=["-o"], metavar="OUT")] = None
    """The scene to write: .glb .usd .usdz .ifc .urdf .sdf .xml; without it, SCENE_fitted.glb in this folder"""
    labels: Annotated[Path | None, arg(metavar="FILE")] = None
    """PLY with NYU40 labels of the points; without it, ScanNet's .labels.ply beside the scene, if there is one"""
    pool: Annotated[Path | None, arg(metavar="FILE")] = None
    """Scan2CAD full_annotations.json whose models of this scan name the results in the lines for its benchmark"""
    up: Literal["auto", "x", "y", "z", "-x", "-y", "-z"] = "auto"
    """Up axis of the scene; auto: z, and y for .glb and .gltf, or, where objects are found, the up direction is too"""
    unit: UnitName | Literal["auto"] = "auto"
    """Unit of the scene's lengths; auto guesses m, cm or mm"""
    top_k: Annotated[int, arg(metavar="K")] = 10
    """How many retrieved models to deform and compare for each object"""
    deform: Deform = "auto"
    """How far a model may be changed (`kpred fit --help`); auto takes the least that explains an object"""
    model_id: Annotated[str | None, arg(metavar="ID")] = None
    """Fit this model of the database to every object"""
    floor: Annotated[bool, arg(help_behavior_hint="")] = True
    """Do not take objects to stand on the scene's floor, where their feet were not scanned"""
    picture: Annotated[bool, arg(help_behavior_hint="")] = True
    """Write no picture"""
    report: Annotated[Path | None, arg(metavar="FILE")] = None
    """Write a page about the room too (.html): every object beside its scan, a 3D view, what stayed unexplained"""
    overwrite: Annotated[bool, arg(help_behavior_hint="")] = False
    """Replace files beside OUT (record, alignments, picture) that kpred did not make"""

    def run(self, output: Output) -> None:
        """Fit, write the files, print what became of each object."""
        from kpred.cli.fit_files import check_foreign
        from kpred.cli.progress import ProgressBar
        from kpred.errors import ScanError
        from kpred.fitting.fit_room import fit_room
        from kpred.fitting.fit_scene import fit_scene
        from kpred.reports.page import check_report
        from kpred.scenes.objects import objects_of
        from kpred.scenes.scan2cad_pool import read_pool
        from kpred.scenes.scene import read_scene, scene_name

        files = self._files(scene_name(self.scene))
        _check_output(files, [self.scene, self.objects, self.labels, self.pool])
        if self.report is not None:
            check_report(self.report)
        if not self.overwrite:
            check_foreign(files[1], files[1:] if self.output is not None else files)
        scene = read_scene(self.scene, None if self.up == "auto" else self.up, self.labels)
        pool = None if self.pool is None else read_pool(self.pool, scene.name)
        finds = self.objects is None and scene.instances is None
        with ProgressBar() as bar:
            options: dict[str, Any] = {
                "progress": lambda done, total, name: bar.update("objects", done, total, name),
                "top_k": self.top_k,
                "deform": self.deform,
                "model_id": self.model_id,
                "floor": self.floor,
                "unit": self.unit,
            }
            if finds:
                result = fit_room(scene, self.model, self.database, up=self.up, **options)
            else:
                result = fit_scene(scene, objects_of(scene, self.objects), self.model, self.database, **options)
        written = self._write(result, pool)
        output.result({**result.to_json(files[0].name), "files": written})
        columns = ["object", "category", "points", "model", "mean distance", "confidence", "ms", ""]
        output.table(f"scene {scene.name}", columns, [_row(item) for item in result.fits])
        if finds:
            output.note(_found(result))
        for item in result.fits:
            if item.error is not None:
                output.note(f"{'skipped' if item.skipped else 'failed'}: {item.error}")
        for file in written:
            output.note(f"wrote {file}")
        for item in result.fitted:
            for sentence in item.fit.warnings if item.fit is not None else ():
                output.caution(f"{item.object.name}: {sentence}")
        if not result.fitted:
            raise ScanError(
                f"{self.scene}: none of its {len(result.fits)} objects could be fitted; {result.fits[0].error}"
            )

    def _files(self, name: str) -> tuple[Path, ...]:
        """Return the paths of GLB, record, annotation, benchmark lines and picture."""
        from kpred.cli.fit_files import default_output

        out = self.output or default_output(self.scene)
        annotation = out.with_name(f"{out.stem}_scan2cad.json")
        return out, out.with_suffix(".json"), annotation, out.with_name(f"{name}.csv"), out.with_suffix(".png")

    def _write(self, result: SceneFit, pool: tuple[AlignedModel, ...] | None) -> list[Path]:
        from kpred._version import __version__
        from kpred.atomic import write_together
        from kpred.fitting.scene_export import scene_writers
        from kpred.json_output import json_text
        from kpred.rendering.scene_picture import save_scene_picture
        from kpred.reports.room_report import room_report

        glb, record_file, annotation, lines, picture = self._files(result.scene.name)
        record = {"kpred": __version__, "scan": self.scene, "glb": glb, **result.to_json(glb.name)}

        def json_writer(content: Any) -> Callable[[Path], object]:
            text = json_text(content)
            return lambda file: file.write_text(text, encoding="utf-8")

        if not result.fitted:
            write_together({record_file: json_writer(record)})
            return [record_file]
        with TemporaryDirectory(prefix="kpred-") as folder:
            scratch = Path(folder) / "picture.png"
            writers: dict[Path, Callable[[Path], object]] = {
                **scene_writers(result, glb),
                record_file: json_writer(record),
                annotation: json_writer(record["scan2cad"]),
                lines: lambda file: result.to_csv(file, pool),
            }
            drawn = scratch if self.picture and save_scene_picture(result, scratch) else None
            if drawn is not None:
                writers[picture] = lambda file: shutil.copyfile(scratch, file)
            if self.report is not None:
                page = room_report(result, drawn)
                writers[self.report] = lambda file: file.write_text(page, encoding="utf-8")
            write_together(writers)
        return list(writers)


def _check_output(files: tuple[Path, ...], inputs: list[Path | None]) -> None:
    """Refuse the output before any work is done for it."""
    from kpred.errors import OutputError
    from kpred.fitting.scene_export import check_scene_file

    out = check_scene_file(files[0])
    if not out.parent.is_dir():
        raise OutputError(f"Cannot write {out}: the folder {out.parent} does not exist; make it first.")
    for source in inputs:
        for file in files:
            if source is not None and source.exists() and file.exists() and file.samefile(source):
                raise OutputError(f"Cannot write {file}: it would overwrite {source}; choose another name or folder.")


def _found(result: SceneFit) -> str:
    """Say what was found in a raw room, in one sentence."""
    import numpy as np

    counts = Counter(item.object.category for item in result.fits)
    kinds = ", ".join(f"{count} {name}{'s' if count > 1 else ''}" for name, count in sorted(counts.items(), key=str))
    tilt = float(np.degrees(np.arccos(np.clip((np.trace(result.leveling) - 1) / 2, -1.0, 1.0))))
    leaning = f", which leans by {tilt:.0f} degrees," if tilt > 0 else ""
    return (
        f"found in the scan{leaning} up {result.scene.up}: {kinds}; {len(result.unexplained)} points belong to no "
        "object, floor or wall"
    )


def _row(item: ObjectFit) -> tuple[Any, ...]:
    points = len(item.object.points)
    if item.fit is None:
        what = "skipped" if item.skipped else "failed"
        return (item.object.name, item.object.category, points, "", None, None, None, what)
    distance = next((m.value for m in item.fit.metrics if m.name == "mean_scan_to_result"), None)
    milliseconds = round(1000 * sum(item.fit.timings.values()))
    doubt = "see the notes" if item.fit.warnings else ""
    model, confidence = item.fit.source.model_id, round(item.fit.confidence, 2)
    return (item.object.name, item.fit.category, points, model, distance, confidence, milliseconds, doubt)


COMMAND: type[Command] = SceneCommand
