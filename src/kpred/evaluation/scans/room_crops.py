"""Fits of crops of virtual rooms, and whether each is right: what confidence in real rooms is calibrated on."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import torch
import trimesh

from kpred.evaluation.database_source import Progress
from kpred.evaluation.metrics.surfaces import Surface
from kpred.evaluation.metrics.symmetry import Symmetry, vertical_symmetry, yaw_between, yaw_error
from kpred.evaluation.scans.calibration import CalibrationSample
from kpred.evaluation.scans.outcome import YAW_RIGHT, FailedFit, FitSettings, moved, try_fit
from kpred.evaluation.scans.scan_outcomes import NEAR
from kpred.ops import Frame
from kpred.ops.rotations import yaw_rotation
from kpred.ops.typing import Float
from kpred.synthetic.rooms.pack import RoomPack
from kpred.training.room_crops import OWN_POINTS, prepare_crops, segmented

KIND = "crop of a room"


@dataclass(frozen=True, eq=False)
class CropTarget:
    """A crop and the truth behind it.

    Attributes:
        category: of the object, `other` if it is of none; scan: (N, 3) what a fit is given, metres or alike, y up.
        whole: (M, 3) the whole surface, unit box; frame: takes the scan's own frame into the unit box.
        symmetry: rotations about the vertical that leave the shape as it is.
    """

    category: str
    scan: Float[np.ndarray, "points 3"]
    whole: Float[np.ndarray, "whole 3"]
    frame: Frame
    symmetry: Symmetry

    def accepts(self, category: str, rotation: Float[np.ndarray, "3 3"], mesh: trimesh.Trimesh) -> bool:
        """Decide whether a result is right: category, yaw up to symmetry, and the whole surface.

        Args:
            rotation: from the scan's axes to canonical ones; mesh: in the scan's frame.
        """
        if category != self.category:
            return False
        error = yaw_error(yaw_between(rotation, self.frame.rotation), self.symmetry)
        distance = Surface(moved(mesh, self.frame)).distances(self.whole).mean()
        return error <= YAW_RIGHT and bool(distance < NEAR)


def draw_crop_targets(
    rooms: Sequence[RoomPack], categories: Sequence[str], count: int, others: float, seed: int
) -> Iterator[CropTarget]:
    """Draw `count` crops with segmentation faults, categories equally often, `others` of them of other things.

    Raises:
        PackError: if there is no crop of one of the categories.
    """
    crops = prepare_crops(rooms, categories, seed)
    generator = torch.Generator().manual_seed(seed)
    rng = np.random.default_rng(seed)
    rows = crops.draw(count, others, generator)
    clouds = segmented(crops, rows, OWN_POINTS, generator).double().numpy()
    names = (*crops.categories, "other")
    for row, cloud in zip(rows.tolist(), clouds, strict=True):
        frame = Frame(
            center=rng.uniform(-3.0, 3.0, 3),
            scale=float(rng.uniform(0.2, 1.2)),
            rotation=yaw_rotation(float(rng.uniform(0, 2 * np.pi))),
        )
        whole = crops.surface[row].double().numpy()
        # Points repeat where there are few: a fit is to see each once.
        scan = frame.from_unit(np.unique(cloud, axis=0))
        symmetry = vertical_symmetry(whole)
        yield CropTarget(names[int(crops.category[row])], rng.permutation(scan), whole, frame, symmetry)


def collect_crop_samples(
    rooms: Sequence[RoomPack],
    settings: FitSettings,
    *,
    limit: int = 400,
    others: float = 0.3,
    progress: Progress | None = None,
    report: Callable[[str], None] = lambda sentence: None,
) -> list[CalibrationSample]:
    """Fit crops of virtual rooms, up axis given.

    Args:
        limit: how many crops; others: fraction of them that are of other things.
        report: called with one sentence for each crop without a result.

    Raises:
        PackError: if there is no crop of one of the model's categories.
    """
    samples: list[CalibrationSample] = []
    targets = draw_crop_targets(rooms, sorted(settings.model.categories), limit, others, settings.seed)
    for done, target in enumerate(targets, start=1):
        found = try_fit(target.scan, settings, up="y")
        if isinstance(found, FailedFit):
            report(f"no result: {target.category}: {found.reason}")
        else:
            right = target.accepts(found.category, found.frame.rotation, found.mesh)
            samples.append(CalibrationSample(target.category, KIND, right, found.evidence))
        if progress is not None:
            progress("crops of rooms", done, limit)
    return samples
