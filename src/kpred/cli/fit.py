"""`kpred fit`: a scan in, a CAD mesh out."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional, arg

from kpred.cli.command import Command
from kpred.cli.output import Output


@dataclass(frozen=True, kw_only=True)
class FitCommand(Command):
    """Fit a CAD model to a scan of one object.

    The result is a mesh in the scan's own place and units. Beside it lie a record (.json) and a picture (.png).

    examples:
      kpred fit chair.ply -o chair.obj
      kpred fit scan.xyz -o table.glb --category table --top-k 25
      kpred fit scan.npy -o result.ply --database mine.kpred --frame known --no-refine --json
      kpred fit corner.pcd -o chair.stl --up z --partial yes
    """

    scan: Annotated[Positional[Path], arg(metavar="SCAN")]
    """Point cloud or mesh of one object: .ply .pcd .xyz .pts .npy .npz .obj .stl .off .glb .gltf"""
    output: Annotated[Path, arg(aliases=["-o"], metavar="OUT")]
    """The mesh to write, by extension: .obj .ply .glb .stl"""
    category: Annotated[str | None, arg(metavar="NAME")] = None
    """chair, table, cabinet, ...; without it, the category that fits best"""
    model: Annotated[str | None, arg(metavar="NAME_OR_PATH")] = None
    """Trained networks: a name or a folder; without it, the bundled ones"""
    database: Annotated[Path | None, arg(metavar="FILE")] = None
    """CAD database (.kpred); without it, the bundled one"""
    top_k: Annotated[int, arg(metavar="K")] = 10
    """How many retrieved models to deform and compare"""
    frame: Literal["auto", "known"] = "auto"
    """auto takes the scan's box and finds its front; known takes the scan as y up, front +z, in its unit box"""
    up: Literal["x", "y", "z", "-x", "-y", "-z"] = "y"
    """Up axis of the scan (not used with --frame known)"""
    partial: Literal["auto", "yes", "no"] = "auto"
    """Whether parts of the object are missing in the scan; auto finds out"""
    refine: Annotated[bool, arg(help_behavior_hint="")] = True
    """Leave out the refinement of keypoints (the paper's protocol)"""
    picture: Annotated[bool, arg(help_behavior_hint="")] = True
    """Write no picture"""

    def run(self, output: Output) -> None:
        """Fit, write the files, print what was chosen."""
        from kpred.cli.fit_files import check_output, describe, write_files
        from kpred.database import Database
        from kpred.fitting.fit_scan import fit
        from kpred.nn import load_model
        from kpred.shapes import read_scan

        check_output(self.output, self.scan)
        scan = read_scan(self.scan)
        model = load_model(self.model) if self.model is not None else None
        database = Database.open(self.database) if self.database is not None else None
        result = fit(
            scan,
            model=model,
            database=database,
            category=self.category,
            top_k=self.top_k,
            frame=self.frame,
            refine=self.refine,
            up=self.up,
            partial={"auto": None, "yes": True, "no": False}[self.partial],
        )
        files = write_files(result, scan, self.output, scan_path=self.scan, picture=self.picture)
        describe(output, result, files)


COMMAND: type[Command] = FitCommand
