"""`kpred fit`: a scan in, a CAD mesh out."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from tyro.conf import FlagConversionOff, Positional, arg

from kpred.cli.command import Command, FitsCommand
from kpred.cli.output import Output
from kpred.cli.remote_fit import fit_remotely, own_resources, server_of
from kpred.cli.usage import UsageError
from kpred.preprocessing.config import CleanConfig
from kpred.refinement.config import Deform, RefineConfig
from kpred.refinement.structure_config import StructureConfig
from kpred.shapes.unit_name import UnitName


@dataclass(frozen=True, kw_only=True)
class FitCommand(FitsCommand):
    """Fit a CAD model to a scan of one object.

    The result is a mesh in the scan's own place and units. Beside it lie a record (.json) and a picture (.png). What
    may be wrong with it is noted on standard error.

    examples:
      kpred fit chair.ply -o chair.obj
      kpred fit scan.xyz -o table.glb --category table --top-k 25
      kpred fit scan.npy -o result.ply --database mine.kpred --frame known --deform paper --json
      kpred fit chair.ply -o chair.obj --report chair.html
      kpred fit chair.ply -o chair.obj --server http://127.0.0.1:8765
      kpred fit chair.ply -o chair.obj --deform none
      kpred fit desk.ply -o desk.obj --database mine.kpred --model-id desk_0042 --deform structure
      kpred fit corner.pcd -o chair.stl --up z --partial yes --floor 0
      kpred fit scan.ply -o desk.obj --sensor 0.4 1.6 2.0 --cleaning.wall False
      kpred fit scan.ply -o chair.obj --pose given:pose.txt --no-clean
      kpred fit scan.ply -o chair.obj --structure.contact 0.1
      kpred fit scan.pcd -o chair.xml --unit mm --density 450
      kpred fit scan.ply -o chair.obj --deform free --refinement.reflection 0
    """

    fits: ClassVar[bool] = True

    scan: Annotated[Positional[Path], arg(metavar="SCAN")]
    """Point cloud or mesh of one object: .ply .pcd .xyz .pts .ptx .las .laz .e57 .npy .npz .obj .stl .off .glb .gltf"""
    output: Annotated[Path | None, arg(aliases=["-o"], metavar="OUT")] = None
    """The file to write, by extension: .obj .ply .stl .off; in metres: .glb .usd .usdz .ifc .urdf .sdf .xml (MJCF);
    without it, SCAN_fitted.glb in this folder"""
    category: Annotated[str | None, arg(metavar="NAME")] = None
    """chair, table, cabinet, ...; without it, the category that fits best"""
    top_k: Annotated[int, arg(metavar="K")] = 10
    """How many retrieved models to deform and compare"""
    frame: Literal["auto", "known"] = "auto"
    """auto takes the scan's box and finds its front; known takes the scan as y up, front +z, in its unit box"""
    up: Literal["auto", "x", "y", "z", "-x", "-y", "-z"] = "auto"
    """Up axis of the scan; auto finds it (not used with --frame known)"""
    pose: Annotated[str | None, arg(metavar="NAME")] = None
    """identity (it faces +z), upright, given:FILE (its 4x4 matrix) or an installed estimator; without it, found"""
    sensor: Annotated[tuple[float, float, float] | None, arg(metavar="X Y Z")] = None
    """Where the scanner stood, in the scan's frame and units; the result keeps out of what it looked through"""
    floor: Annotated[float | None, arg(metavar="HEIGHT")] = None
    """Height of the floor along the up axis, in the scan's frame and units; the object stands on it"""
    partial: Literal["auto", "yes", "no"] = "auto"
    """Whether parts of the object are missing in the scan; auto finds out"""
    deform: Deform = "auto"
    """How far a model may be changed. none: placed, scale: sized along each axis, structure: its parts move and
    grow while what is flat, square and mirrored stays so, free: bent by refined keypoints, paper: bent as the
    network says; auto takes the least of the first three that explains the scan"""
    model_id: Annotated[str | None, arg(metavar="ID")] = None
    """Fit this model of the database, and no other"""
    unit: UnitName | Literal["auto"] = "auto"
    """Unit of the scan's lengths, for files in metres; auto guesses it from the object's size"""
    density: Annotated[float, arg(metavar="KG_PER_M3")] = 600.0
    """Density of the furniture, for simulations (.urdf .sdf .xml)"""
    picture: Annotated[bool, arg(help_behavior_hint="")] = True
    """Write no picture"""
    report: Annotated[Path | None, arg(metavar="FILE")] = None
    """Write a page about the fit too (.html): picture, 3D view, numbers, candidates; it needs no other file"""
    server: Annotated[str | None, arg(metavar="ADDRESS")] = None
    """Let a running `kpred serve` fit, as http://127.0.0.1:8765, without the seconds of start-up; without it, the one
    that the environment variable KPRED_SERVER names, if any"""
    overwrite: Annotated[bool, arg(help_behavior_hint="")] = False
    """Replace files beside OUT (record, picture) that kpred did not make"""
    clean: Annotated[bool, arg(help_behavior_hint="")] = True
    """Take the scan as it is: leave out all steps of cleaning"""
    cleaning: Annotated[CleanConfig, FlagConversionOff] = field(default_factory=CleanConfig)
    """Steps of cleaning, one by one; with --frame known the scan is cleaned only if a setting is changed"""
    structure: Annotated[StructureConfig, FlagConversionOff] = field(default_factory=StructureConfig)
    """Settings of --deform auto and structure, one by one"""
    refinement: Annotated[RefineConfig, FlagConversionOff] = field(default_factory=RefineConfig)
    """Settings of --deform free, one by one"""

    @property
    def compiles(self) -> bool:
        """Whether it fits here, and not by a server."""
        return server_of(self) is None

    def run(self, output: Output) -> None:
        """Fit, write the files, print what was chosen."""
        from kpred.cli.fit_files import check_output, default_output, describe
        from kpred.reports.page import check_report

        self._check()
        target = self.output or default_output(self.scan)
        more = [] if self.output is not None else [target]
        if self.report is not None:
            check_report(self.report)
        check_output(target, self.scan, self.overwrite, self.picture, more)
        address = server_of(self)
        if address is None:
            record, files = self._fit_here(target)
        else:
            record, files = fit_remotely(self, address, target, output)
        describe(output, record, files)

    def _fit_here(self, target: Path) -> tuple[dict[str, Any], list[Path]]:
        """Fit in this process, write the files, and return the record and the files."""
        import numpy as np

        from kpred.database import Database
        from kpred.fitting.pipeline import fit
        from kpred.nn import load_model
        from kpred.reports.fit_files import write_files
        from kpred.shapes import read_scan
        from kpred.shapes.mesh_output import check_precision

        scan = read_scan(self.scan)
        check_precision(target, scan)
        model = load_model(self.model) if self.model is not None else None
        database = Database.open(self.database) if self.database is not None else None
        result = fit(
            scan,
            model=model,
            database=database,
            category=self.category,
            top_k=self.top_k,
            frame=self.frame,
            deform=self.deform,
            model_id=self.model_id,
            up=self.up,
            partial={"auto": None, "yes": True, "no": False}[self.partial],
            pose=self.pose,
            sensor=None if self.sensor is None else np.array(self.sensor),
            floor=self.floor,
            clean=self.clean if self.cleaning == CleanConfig() else self.cleaning,
            refinement=self.refinement,
            structure=self.structure,
            unit=self.unit,
        )
        result = replace(result, source_data=result.source_data.from_file(self.scan))
        written = write_files(
            result,
            scan,
            target,
            scan_path=self.scan,
            picture=self.picture,
            density=self.density,
            report=self.report,
        )
        return written.record, written.files

    def _check(self) -> None:
        """Refuse options that contradict each other."""
        if self.server is not None and (option := own_resources(self)) is not None:
            raise UsageError(
                f"A server has its own model and database and reads no files; leave out {option} or --server."
            )
        if self.frame == "known" and (self.pose is not None or self.floor is not None):
            raise UsageError("--frame known says how and where the scan stands; leave out --pose and --floor.")
        if not self.clean and self.cleaning != CleanConfig():
            raise UsageError("--no-clean leaves out all steps of cleaning; leave out --no-clean or the settings.")
        if self.deform != "free" and self.refinement != RefineConfig():
            raise UsageError("--refinement settings are those of --deform free; add it, or leave out the settings.")
        if self.deform not in ("auto", "structure") and self.structure != StructureConfig():
            raise UsageError("--structure settings are those of --deform auto and structure; leave them out.")
        if not 0 < self.density < math.inf:
            raise UsageError("--density must be a number of kilograms per cubic metre above 0.")
        for value in (*(self.sensor or ()), *(() if self.floor is None else (self.floor,))):
            if not math.isfinite(value):
                raise UsageError("--sensor and --floor must be finite numbers.")


COMMAND: type[Command] = FitCommand
