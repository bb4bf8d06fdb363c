"""A raw room to CAD, with nothing given: up direction, objects, a fit of each, and all of them together."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from kpred.database import Database
from kpred.detection.detect import Detection, detect_objects
from kpred.detection.networks import Detector
from kpred.detection.objects import detected_floor, detected_objects, level_scene, unexplained
from kpred.errors import ScanError
from kpred.fitting.arrangement import arrange
from kpred.fitting.equal_objects import share_models
from kpred.fitting.fit_scene import SceneFit, fit_scene
from kpred.fitting.object_fit import ObjectFit
from kpred.nn import Model
from kpred.ops.typing import Float
from kpred.scenes.floor import SceneFloor
from kpred.scenes.scene import Scene
from kpred.shapes.unit import METRES

MIN_WIDTH, MAX_WIDTH = 2.0, 45.0
"""Metres: longest side of a room; what is smaller is one object, and what is larger a building or the open."""


@dataclass(frozen=True, eq=False)
class LevelRoom:
    """The fits of a room in a frame in which it stands upright.

    Attributes:
        scan: the room as it was scanned; up: the up axis of the level frame.
        fits: in the level frame; floor: there, if it was found.
        leveling: rotation (3, 3) from the scan's frame to the level one.
        unexplained: rows of the scan's points of no object, floor, wall or ceiling.
    """

    scan: Scene
    up: str
    fits: tuple[ObjectFit, ...]
    floor: SceneFloor | None = None
    leveling: Float[np.ndarray, "3 3"] = field(default_factory=lambda: np.eye(3))
    unexplained: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))

    @classmethod
    def of(cls, fitted: SceneFit) -> LevelRoom:
        """Take the fits of a scene that stands upright."""
        return cls(fitted.scene, fitted.scene.up, fitted.fits, fitted.floor)

    def in_scan(self, fits: Sequence[ObjectFit] | None = None) -> SceneFit:
        """Return the fits, or others in the level frame, in the frame of the scan."""
        back, level = self.leveling.T, self.fits if fits is None else fits
        if not np.array_equal(back, np.eye(3)):
            level = [item.rotated(back) for item in level]
        return SceneFit(replace(self.scan, up=self.up), tuple(level), self.floor, self.leveling, self.unexplained)


def fit_room(
    scene: Scene,
    model: Model | str | os.PathLike[str] | None = None,
    database: Database | str | os.PathLike[str] | None = None,
    progress: Callable[[int, int, str], None] | None = None,
    up: str = "auto",
    detector: Detector | None = None,
    floor: bool = True,
    share: bool = True,
    **fit_options: Any,
) -> SceneFit:
    """Find the furniture of a room, fit a CAD model to each piece, and put the results together.

    Args:
        scene: the scan; neither its labels nor its up axis are used.
        model, database, progress, fit_options: as for `kpred.fitting.fit_scene.fit_scene`.
        up: the up axis (x, y, z, -x, -y, -z); `auto` finds the up direction, which need not be an axis.
        detector: networks that find objects; None means bundled.
        floor: take furniture to stand on the floor, also where its feet were not scanned.
        share: give equal things one model and its deformation, where their scans agree with it.

    Raises:
        ScanError: nothing was found.
        ModelError, DatabaseError: they are missing, or the database was made by other weights.
    """
    return fit_level_room(scene, model, database, progress, up, detector, floor, share, **fit_options).in_scan()


def fit_level_room(
    scene: Scene,
    model: Model | str | os.PathLike[str] | None = None,
    database: Database | str | os.PathLike[str] | None = None,
    progress: Callable[[int, int, str], None] | None = None,
    up: str = "auto",
    detector: Detector | None = None,
    floor: bool = True,
    share: bool = True,
    **fit_options: Any,
) -> LevelRoom:
    """Fit a room as `fit_room` does, and leave the results in the frame in which it stands upright.

    Raises:
        ScanError: nothing was found.
        ModelError, DatabaseError: they are missing, or the database was made by other weights.
    """
    if progress is not None:
        progress(0, 1, "objects of the room")
    unit = fit_options.get("unit", "auto")
    found = detect_objects(scene.points, up, detector, metres=METRES.get(unit))
    width = _width(scene) * found.gravity.metres
    if width > MAX_WIDTH:
        raise ScanError(
            f"{scene.path or scene.name}: it is {width:.0f} m wide, too wide for a room; cut one room out of it, or "
            "name the objects with --objects."
        )
    if width < MIN_WIDTH:
        raise ScanError(
            f"{scene.path or scene.name}: it is {width:.1f} m wide, the scan of one object and no room; fit it with "
            "`kpred fit`, or name the objects with --objects."
        )
    if not found.objects:
        raise ScanError(f"{scene.path or scene.name}: {_nothing_found(scene, found)}")
    level = level_scene(scene, found)
    ground = detected_floor(found) if floor else None
    objects = detected_objects(level, found)
    fitted = fit_scene(level, objects, model, database, progress, False if ground is None else ground, **fit_options)
    equal = share_models(fitted.fits, level.up, found.gravity.metres) if share else fitted.fits
    fits = arrange(equal, level.up, ground, found.gravity.metres, level.points)
    leveling = found.gravity.rotation
    rest = unexplained(scene, found)
    return LevelRoom(scene, level.up, tuple(fits), ground, leveling, rest)


def _nothing_found(scene: Scene, found: Detection) -> str:
    finite = int(np.isfinite(scene.points).all(axis=1).sum())
    if found.structure.sum() > 0.9 * finite:
        return "it shows floor and walls only; scan furniture too, or name the objects with --objects."
    return "no chair, table or cabinet was found in it; name the objects with --objects."


def _width(scene: Scene) -> float:
    """Measure the longest side of a scene, without its outermost percent, in its unit."""
    finite = scene.points[np.isfinite(scene.points).all(axis=1)]
    return float(np.ptp(np.quantile(finite[:: max(1, len(finite) // 100_000)], [0.005, 0.995], axis=0), axis=0).max())
