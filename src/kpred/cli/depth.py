"""`kpred fit-depth`: depth pictures in, a CAD mesh out, drawn over the photograph if there is one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial as partial_call
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from tyro.conf import Positional, arg

from kpred.cli.command import Command, FitsCommand
from kpred.cli.output import Output
from kpred.cli.usage import UsageError
from kpred.refinement.config import Deform

if TYPE_CHECKING:
    from kpred.fitting import Fit
    from kpred.nn import Model
    from kpred.shapes.depth import MergedScan

_SURE = 0.5
"""Confidence below which the result is more likely wrong than right."""


@dataclass(frozen=True, kw_only=True)
class FitDepthCommand(FitsCommand):
    """Fit a CAD model to one object in depth pictures of a known camera.

    The result is a mesh in the world of the poses, in metres; without poses it is in the camera's own axes (x right,
    y down, z forward). Beside it lie a record (.json), a picture (.png) and, with --rgb, the result drawn over the
    photograph (_overlay.png).

    examples:
      kpred fit-depth frame.png --intrinsics camera.txt --mask chair.png -o chair.obj
      kpred fit-depth 0.png 9.png --intrinsics camera.txt --pose 0.txt 9.txt --up z -o c.glb
      kpred fit-depth frame.png --intrinsics camera.txt --mask chair.png --deform none -o chair.obj
      kpred fit-depth CAPTURE --mask MASKS -o chair.obj
      kpred fit-depth frame.png --intrinsics camera.json --mask ids.png --mask-id 7 --rgb frame.jpg -o table.ply
    """

    fits: ClassVar[bool] = True

    depth: Annotated[Positional[tuple[Path, ...]], arg(metavar="DEPTH [DEPTH ...]")]
    """Depth pictures: 16-bit .png or .tiff in millimetres, .npy or .tiff of floats in metres; or one folder of them
    with their poses, as ScanNet, TUM, Replica, ARKitScenes, nerfstudio, Polycam, Stray Scanner, ... write it"""
    intrinsics: Annotated[Path | None, arg(metavar="FILE")] = None
    """Camera matrix: .txt (3 x 3, 4 x 4, or fx fy cx cy), .json, .yaml (of RealSense, ROS, ScanNet, Open3D, ARKit,
    Azure Kinect, nerfstudio, ...) or .npy; that of a larger picture of the same view is scaled. Needed, but for folders
    that hold it"""
    output: Annotated[Path | None, arg(aliases=["-o"], metavar="OUT")] = None
    """The file to write, by extension, as of kpred fit; .glb .usdz .xml ... are y or z up, in metres; without it,
    DEPTH_fitted.glb in this folder"""
    pose: Annotated[tuple[Path, ...], arg(metavar="FILE [FILE ...]")] = ()
    """Camera-to-world matrix of each picture: .txt, .json, .yaml or .npy, metres; x right, y down, z forward, but under
    the key transform_matrix (nerfstudio) y up, z backward. Without it, how far the camera looks down is estimated"""
    mask: Annotated[tuple[Path, ...], arg(metavar="FILE [FILE ...]")] = ()
    """The object's pixels in each picture: .png of instance ids, or boolean .npy; of a folder, a folder of masks with
    the names of the pictures"""
    mask_id: Annotated[int | None, arg(metavar="N")] = None
    """The object's id in the masks; without it, all that is not 0"""
    rgb: Annotated[Path | None, arg(metavar="FILE")] = None
    """Photograph of the first picture's view, over which the result is drawn"""
    depth_scale: Annotated[float | None, arg(metavar="UNITS")] = None
    """Units per metre in the depth pictures; without it, what the intrinsics file says of whole numbers, else 1000,
    and 1 for floats"""
    views: Annotated[int, arg(metavar="N")] = 60
    """Pictures of a folder that are used, evenly spread"""
    max_depth: Annotated[float, arg(metavar="METRES")] = 10.0
    """Depths beyond are dropped"""
    remove_flying: Annotated[bool, arg(help_behavior_hint="")] = True
    """Keep flying pixels, which float between front and back at the edges of objects"""
    voxel: Annotated[float, arg(metavar="METRES")] = 0.005
    """Of several pictures' points in a cube of this side, one is kept; 0 keeps all"""
    up: Literal["auto", "x", "y", "z", "-x", "-y", "-z"] | None = None
    """Up axis of the world, auto finds it; without it, y with poses (ScanNet: z), and for folders what their programs
    write; without poses, -y of a camera that may look down, or, named, of one that looks level"""
    category: Annotated[str | None, arg(metavar="NAME")] = None
    """chair, table, cabinet, ...; without it, the category that fits best"""
    top_k: Annotated[int, arg(metavar="K")] = 10
    """How many retrieved models to deform and compare"""
    partial: Literal["auto", "yes", "no"] = "auto"
    """Whether parts of the object are missing; auto: yes with one picture, found out with several"""
    deform: Deform = "auto"
    """How far a model may be changed (`kpred fit --help`); auto takes the least that explains the scan"""
    model_id: Annotated[str | None, arg(metavar="ID")] = None
    """Fit this model of the database, and no other"""
    picture: Annotated[bool, arg(help_behavior_hint="")] = True
    """Write no picture of scan and result"""
    overwrite: Annotated[bool, arg(help_behavior_hint="")] = False
    """Replace files beside OUT (record, picture) that kpred did not make"""

    def run(self, output: Output) -> None:
        """Back-project, fit, write the files, print what was chosen."""
        from kpred.cli.fit_files import check_output, default_output, describe
        from kpred.database import Database
        from kpred.errors import OutputError
        from kpred.fitting.defaults import resolve_model
        from kpred.fitting.pipeline import fit
        from kpred.pose.tilt import tilt_rotation
        from kpred.rendering.overlay import save_overlay
        from kpred.reports.fit_files import write_files

        self._check_usage()
        target = self.output or default_output(self.depth[0])
        overlay_file = target.with_name(f"{target.stem}_overlay.png")
        beside = [*([overlay_file] if self.rgb else []), *([] if self.output is not None else [target])]
        named = [file for file in (self.intrinsics, self.rgb) if file is not None]
        for file in (*self.depth, *self.mask, *self.pose, *named):
            check_output(target, file, self.overwrite, self.picture, beside)
            if self.rgb is not None and overlay_file.exists() and file.exists() and overlay_file.samefile(file):
                raise OutputError(f"Cannot write {overlay_file}: it would overwrite {file}; choose another name.")
        scan, up = self._scan(output)
        # One depth picture shows one side only.
        partial = {"auto": None if len(scan.scans) > 1 else True, "yes": True, "no": False}[self.partial]
        model = resolve_model(self.model)
        tilt = 0.0 if up is not None else self._tilt(scan, model, output)
        level = tilt_rotation(tilt)
        result = fit(
            scan.points @ level.T,
            model=model,
            database=Database.open(self.database) if self.database is not None else None,
            category=self.category,
            top_k=self.top_k,
            deform=self.deform,
            model_id=self.model_id,
            up="-y" if tilt else self.up or up or ("y" if self.pose else "-y"),
            partial=partial,
            unit="m",
            # Without poses the world is the camera's own frame, and this is its origin.
            sensor=scan.origins @ level.T,
        )
        if tilt:
            result = result.rotated(level.T)
        result = replace(result, warnings=(*result.warnings, *self._doubts(result, has_poses=up is not None)))
        overlay: dict[Path, Callable[[Path], object]] = {}
        if self.rgb is not None:
            overlay[overlay_file] = partial_call(
                save_overlay, result.mesh.vertices, result.mesh.faces, scan.scans[0].camera, self.rgb
            )
        written = write_files(result, scan.points, target, scan_path=self.depth[0], picture=self.picture, more=overlay)
        describe(output, written.record, written.files)

    def _tilt(self, scan: MergedScan, model: Model, output: Output) -> float:
        """Find by how much a camera without a pose looks down (radians); 0 with a pose or a named up axis."""
        import numpy as np

        from kpred.pose.tilt import find_tilt

        if self.pose or self.up not in (None, "auto") or model.recognizer is None:
            return 0.0
        tilt = find_tilt(np.random.default_rng(0).permutation(scan.points), model.recognizer)
        if tilt:
            output.note(f"the camera seems to look down by {np.degrees(tilt):.0f} degrees; give --pose if you know it")
        return tilt

    @property
    def _is_folder(self) -> bool:
        """Whether one folder with its own poses is given."""
        return len(self.depth) == 1 and self.depth[0].is_dir()

    def _check_usage(self) -> None:
        """Refuse options that do not belong together."""
        if self._is_folder:
            if self.pose or self.rgb is not None:
                raise UsageError("A folder of depth pictures has poses of its own; leave --pose and --rgb out.")
        elif self.intrinsics is None:
            raise UsageError("--intrinsics is needed for depth pictures; only folders can hold them.")
        for given, what in ((self.pose, "--pose"), (self.mask, "--mask")):
            if given and len(given) != len(self.depth):
                raise UsageError(
                    f"{what} names {len(given)} files for {len(self.depth)} depth pictures; give one each."
                )
        if len(self.depth) > 1 and not self.pose:
            raise UsageError("Several depth pictures can only be merged with their poses; give --pose, one each.")
        if self.mask_id is not None and not self.mask:
            raise UsageError("--mask-id needs --mask.")

    def _doubts(self, result: Fit, has_poses: bool) -> list[str]:
        """Return warnings about the depths' unit and a missing pose."""
        import numpy as np

        from kpred.shapes.furniture_size import size_warning

        size = np.ptp(result.mesh.bounds, axis=0)
        too_large = size_warning(size, result.category, "give --depth-scale (RealSense often 4000, TUM 5000)")
        found = [] if too_large is None else [too_large]
        if not self.pose and not has_poses and result.confidence < _SURE:
            found.append("No --pose was given, so up was estimated from the object; give --pose if you know it.")
        return found

    def _scan(self, output: Output) -> tuple[MergedScan, str | None]:
        """Read the pictures as one cloud of points, with the up axis that a folder's layout names."""
        if self._is_folder:
            return self._folder_scan(output)
        return self._picture_scan(output), None

    def _folder_scan(self, output: Output) -> tuple[MergedScan, str]:
        """Read a folder of depth pictures with their poses, and the up axis of its layout."""
        from kpred.shapes.captures.masks import mask_finder
        from kpred.shapes.captures.read import capture_scan, read_capture
        from kpred.shapes.intrinsics_file import read_intrinsics_file

        given = None if self.intrinsics is None else read_intrinsics_file(self.intrinsics)
        capture = read_capture(self.depth[0], given)
        scan = capture_scan(
            capture,
            views=self.views,
            voxel=self.voxel,
            depth_scale=self.depth_scale,
            farthest=self.max_depth,
            remove_flying=self.remove_flying,
            mask_of=mask_finder(self.mask[0], self.mask_id) if self.mask else None,
        )
        if not self.mask:
            output.note("no --mask: everything in the depth pictures is taken as the object")
        if capture.lost:
            output.note(f"{capture.lost} depth pictures have no pose and were left out")
        output.note(
            f"scan: {len(scan.points)} points of {len(scan.scans)} of {len(capture.frames)} depth pictures in the "
            f"layout of {capture.kind}, up {capture.up}"
        )
        return scan, capture.up

    def _picture_scan(self, output: Output) -> MergedScan:
        """Read single pictures as one cloud of points, and check the photograph."""
        import numpy as np

        from kpred.rendering.overlay import read_photograph
        from kpred.shapes.depth import merge_views, read_depth, read_mask, scan_depth
        from kpred.shapes.depth_camera import depth_camera
        from kpred.shapes.intrinsics_file import read_intrinsics_file
        from kpred.shapes.pose_file import read_pose

        assert self.intrinsics is not None  # checked before
        intrinsics = read_intrinsics_file(self.intrinsics)
        photograph = None if self.rgb is None else read_photograph(self.rgb)
        photograph_size = None if photograph is None else (photograph.shape[1], photograph.shape[0])
        views, seen, beyond = [], 0, 0
        for number, file in enumerate(self.depth):
            depth = read_depth(file, self.depth_scale, intrinsics.units_per_metre)
            intrinsics = read_intrinsics_file(self.intrinsics, depth.shape[::-1])
            pose = read_pose(self.pose[number], file) if self.pose else np.eye(4)
            camera = depth_camera(depth, intrinsics, pose, str(file), str(self.intrinsics), photograph_size)
            if number == 0 and photograph_size is not None:
                camera.resized(*photograph_size)
            mask = read_mask(self.mask[number], self.mask_id) if self.mask else None
            views.append(
                scan_depth(
                    depth, camera, mask, farthest=self.max_depth, remove_flying=self.remove_flying, name=str(file)
                )
            )
            inside = depth > 0 if mask is None else (depth > 0) & mask
            seen, beyond = seen + int(inside.sum()), beyond + int((inside & (depth > self.max_depth)).sum())
        scan = merge_views(views, self.voxel)
        if not self.mask:
            output.note("no --mask: everything in the depth pictures is taken as the object")
        if not self.pose:
            output.note("no --pose: the camera is taken to be held level, and to look ahead or down")
        if beyond > 0.1 * seen:
            output.caution(
                f"{beyond} of {seen} pixels lie beyond {self.max_depth:g} m and were left out; check --depth-scale."
            )
        output.note(f"scan: {len(scan.points)} points of {len(views)} depth picture{'s' if len(views) > 1 else ''}")
        return scan


COMMAND: type[Command] = FitDepthCommand
