"""Category, yaw and box of a scan are hypotheses; the one whose quickly refined candidates fit best is taken."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from kpred.database import Database
from kpred.fitting.candidates import Candidates, retrieve
from kpred.fitting.observation import observe
from kpred.fitting.refine import RefineConfig, refine_keypoints
from kpred.nn import KPRed, Model
from kpred.ops import nearest_neighbours, squared_distances
from kpred.ops.frames import Frame

SCREEN = RefineConfig(iterations=3, points=256, prior=0.05)
"""Quick refinement by which hypotheses are compared."""

SCREEN_POINTS = 512
"""Points of the scan by which hypotheses are compared, in random order like all of them."""

SCREENED = 3
"""Candidates of each hypothesis that are screened."""

TURN_PENALTY = 1.1
"""A scan is taken as it stands unless turning it lowers the error by more than this factor: stools have no front."""

UNSEEN_DISTANCE = 0.1
UNSEEN_SHARE = 0.02
"""A scan is taken as partial if more than this share of the best full-shape result is farther than this from it.

On depth scans of training shapes a partial scan read as full lies ten times farther from the true surface than read as
partial, while a full scan read as partial is no worse: when in doubt, a scan is partial.
"""


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """One reading of the scan.

    Attributes:
        candidates: retrieved and deformed models, in this frame's unit box.
        frame: takes the scan into the unit box; error: by which readings are compared, unit box squared.
    """

    candidates: Candidates
    frame: Frame
    error: float

    @property
    def category(self) -> str:
        """Category of the candidates."""
        return self.candidates.category


def hypotheses(
    points: np.ndarray,
    frames: Sequence[Frame],
    model: Model,
    database: Database,
    categories: Sequence[str],
    top_k: int,
    partial: bool,
    frame_known: bool,
) -> list[Hypothesis]:
    """The best frame for each category, best category first.

    Args:
        points: (N, 3) the scan in its own frame and units.
        frames: of the visible part's box, or the known one.
        partial: partial networks and one-sided errors; unless the frame is known, each frame is first extended to the
            box that the network expects of the whole object.
    """
    found = []
    for category in categories:
        network = model[category]
        tried = whole_frames(points, frames, network) if partial and not frame_known else list(frames)
        alone = len(tried) * len(categories) == 1
        clouds = _clouds(points, tried)
        observation = observe(clouds if alone else clouds[:, :SCREEN_POINTS], network, partial)
        candidates = [retrieve(observation, row, database, category, top_k, partial) for row in range(len(tried))]
        errors = [0.0] if alone else _screen(candidates)
        readings = [
            Hypothesis(read, frame, error * (1.0 if row == 0 else TURN_PENALTY))
            for row, (read, frame, error) in enumerate(zip(candidates, tried, errors, strict=True))
        ]
        found.append(min(readings, key=lambda reading: reading.error))
    found.sort(key=lambda reading: reading.error)
    if not alone:
        # The others were only compared; the best is read again with all points.
        best = found[0]
        observation = observe(_clouds(points, [best.frame]), model[best.category], partial)
        found[0] = replace(best, candidates=retrieve(observation, 0, database, best.category, top_k, partial))
    return found


def whole_frames(points: np.ndarray, frames: Sequence[Frame], network: KPRed) -> list[Frame]:
    """Frames of the visible box -> frames of the box that the whole object is expected to have."""
    with torch.inference_mode():
        corners, _ = network.whole_box(_clouds(points, frames)[:, :SCREEN_POINTS])
    wholes = []
    for frame, (low, high) in zip(frames, corners.double().numpy(), strict=True):
        middle, half = (low + high) / 2, float((high - low).max() / 2)
        wholes.append(Frame(frame.from_unit(middle), frame.scale * half, frame.rotation))
    return wholes


def looks_partial(reading: Hypothesis) -> bool:
    """Whether much of the best full-shape explanation lies where the scan has no points."""
    order = reading.candidates.errors(most=512).argsort()[:SCREENED]
    close = reading.candidates.refined(SCREEN, order)
    best = close.take(close.errors(most=512).argmin()[None])
    squared, _ = nearest_neighbours(best.deformed()[:, ::2].contiguous(), best.target[None])
    return float((squared > UNSEEN_DISTANCE**2).float().mean()) > UNSEEN_SHARE


def _clouds(points: np.ndarray, frames: Sequence[Frame]) -> Tensor:
    return torch.stack([torch.from_numpy(frame.to_unit(points)).float() for frame in frames])


def _screen(readings: Sequence[Candidates]) -> list[float]:
    """Lowest error of each reading after a quick refinement of its best candidates, all readings in one batch.

    Points are few and in random order; the models' are taken at even steps.
    """
    partial, count = readings[0].partial, len(readings[0].model_ids)
    step = max(1, readings[0].points.shape[1] // SCREEN.points)
    points = torch.cat([reading.points[:, ::step] for reading in readings])
    basis = torch.cat([reading.basis[:, ::step] for reading in readings])
    displacement = torch.cat([reading.displacement for reading in readings])
    goals = torch.stack([reading.target[: SCREEN.points] for reading in readings]).repeat_interleave(count, 0)
    confidence = torch.stack([reading.confidence for reading in readings]).repeat_interleave(count, 0)

    def errors(rows: Tensor) -> Tensor:
        result = points[rows] + basis[rows] @ displacement[rows]
        forth = squared_distances(goals[rows], result).mean(1)
        return forth if partial else forth + squared_distances(result, goals[rows]).mean(1)

    everyone = torch.arange(len(points))
    kept = errors(everyone).view(len(readings), count).topk(min(SCREENED, count), largest=False).indices
    rows = (kept + count * torch.arange(len(readings))[:, None]).flatten()
    displacement[rows] = refine_keypoints(
        points[rows], basis[rows], displacement[rows], goals[rows], confidence[rows], SCREEN, partial
    )
    return errors(rows).view(len(readings), -1).amin(1).tolist()
