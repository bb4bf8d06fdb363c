"""Hypotheses of category, yaw and box of a scan, ranked by likelihood and by a quick fit."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from kpred.database import Database
from kpred.fitting.candidates import Candidates, retrieve
from kpred.fitting.encoding import encode_scan
from kpred.nn import KPRed, Model
from kpred.ops import squared_distances, unit_box_frame
from kpred.ops.frames import Frame
from kpred.ops.typing import Float
from kpred.pose.recognition import PoseHypothesis
from kpred.refinement.keypoints import RefineConfig, refine_keypoints

SCREEN = RefineConfig(iterations=3, points=256, prior=0.05, unseen=0.5)
"""Quick refinement by which hypotheses are compared."""

SCREEN_POINTS = 512
"""Points of the scan by which hypotheses are compared, in random order like all of them."""

SCREENED = 3
"""Candidates of each hypothesis that are screened."""

ERROR_WEIGHT = 2.5
"""Odds fall with this power of the error of the quick fit. Of 900 depth scans of training shapes powers from 2 to 3
find yaw and category of the most, 86 and 95 %; a power of 1 finds four and two fewer, one of 0 seven and three.
"""

MIN_SIDE = 0.12
"""Minimum side of furniture, as a fraction of the longest; a thinner box shows one plate only."""

USUAL_SIDES = (0.7, 0.5, 0.35)
"""Width, height and depth, as fractions of the longest side, that such a plate's object is taken to have."""


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """One reading of the scan, tried.

    Attributes:
        candidates: retrieved and deformed models, in this frame's unit box.
        frame: takes the scan into the unit box.
        error: of the best quick fit, unit box squared.
        score: log of how likely the reading is, up to a constant: by the recognizer's odds and by the error.
        log_odds: of the reading, by the recognizer; 0 without one.
        box_error: mean error expected of the faces of the whole object's box, unit box; 0 where the frame is known, and
            for full scans.
    """

    candidates: Candidates
    frame: Frame
    error: float
    score: float
    log_odds: float = 0.0
    box_error: float = 0.0

    @property
    def category(self) -> str:
        """Category of the candidates."""
        return self.candidates.category


@dataclass(frozen=True, eq=False)
class Search:
    """What hypotheses are tried against.

    Attributes:
        model, database: the networks, and the models they encoded.
        top_k: candidates of each hypothesis while several are compared; retrieved: of the one that is deformed.
        frame_known: the scan lies in its whole object's unit box.
        floor: height along the up axis, after `upright`, where it is known.
    """

    model: Model
    database: Database
    top_k: int
    retrieved: int
    frame_known: bool
    floor: float | None = None


def hypotheses(
    points: np.ndarray, readings: Sequence[PoseHypothesis], search: Search, partial: bool
) -> list[Hypothesis]:
    """Try every pose hypothesis; return the results, the likeliest first.

    Args:
        points: (N, 3) the scan in its own frame and units.
        partial: partial networks and one-sided errors; unless the frame is known, the box is extended to the one that
            the network expects of the whole object, which stands on the floor where that is known.
    """
    found: list[Hypothesis] = []
    alone = len(readings) == 1
    # Categories that share a network are encoded together.
    for network in dict.fromkeys(search.model[reading.category] for reading in readings):
        tried = [reading for reading in readings if search.model[reading.category] is network]
        frames, box_errors = _frames(points, tried, network, search, partial)
        clouds = _clouds(points, frames)
        encoding = encode_scan(clouds if alone else clouds[:, :SCREEN_POINTS], network, partial)
        count = search.retrieved if alone else search.top_k
        candidates = [
            retrieve(encoding, row, search.database, reading.category, count, partial)
            for row, reading in enumerate(tried)
        ]
        errors = [1.0] if alone else _screen_by_category(candidates)
        for reading, read, frame, box_error, error in zip(tried, candidates, frames, box_errors, errors, strict=True):
            # Errors are compared in the scan's unit: boxes differ between readings.
            score = reading.log_odds - ERROR_WEIGHT * math.log(max(error * frame.scale**2, 1e-300))
            found.append(Hypothesis(read, frame, error, score, reading.log_odds, box_error))
    found.sort(key=lambda hypothesis: -hypothesis.score)
    if not alone:
        # They were only compared; the best is read again with all points.
        best = found[0]
        encoding = encode_scan(_clouds(points, [best.frame]), search.model[best.category], partial)
        again = retrieve(encoding, 0, search.database, best.category, search.retrieved, partial)
        found[0] = replace(best, candidates=again)
    return found


def _frames(
    points: np.ndarray, readings: Sequence[PoseHypothesis], network: KPRed, search: Search, partial: bool
) -> tuple[list[Frame], list[float]]:
    none = [0.0] * len(readings)
    if search.frame_known:
        return [Frame(center=np.zeros(3), scale=1.0) for _ in readings], none
    frames = [unit_box_frame(points, reading.rotation) for reading in readings]
    return whole_frames(points, frames, network, search.floor) if partial else (frames, none)


def whole_frames(
    points: np.ndarray, frames: Sequence[Frame], network: KPRed, floor: float | None = None
) -> tuple[list[Frame], list[float]]:
    """Predict frames of whole objects' boxes from frames of visible boxes, and their errors.

    The errors are what the network expects, mean over the box's faces, in the new frames' unit box. `floor` is its
    height along the frames' y axis before they centre and scale; the box then stands on it.
    """
    with torch.inference_mode():
        corners, spread = network.whole_box(_clouds(points, frames)[:, :SCREEN_POINTS])
    wholes, errors = [], []
    for frame, (low, high), error in zip(frames, corners.double().numpy(), spread.double().numpy(), strict=True):
        low, high = thickened(low, high)
        if floor is not None:
            level = (floor - float((frame.rotation @ frame.center)[1])) / frame.scale
            low[1] = min(level, high[1] - 0.05)
        middle, half = (low + high) / 2, float((high - low).max() / 2)
        wholes.append(Frame(frame.from_unit(middle), frame.scale * half, frame.rotation))
        errors.append(float(error.mean()) / half)
    return wholes, errors


def thickened(
    low: Float[np.ndarray, "3"], high: Float[np.ndarray, "3"]
) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]:
    """Return the corners of a box, canonical axes, with each side at least as thick as furniture.

    Where only one plate was seen, the network may see no sign of what is behind it. A plate across the depth is then
    taken as the front, since the reading says that it faces +z, a level one as the top; to the side both are likely.
    """
    low, high = low.copy(), high.copy()
    side, longest = high - low, float((high - low).max())
    for axis in np.flatnonzero(side < MIN_SIDE * longest):
        more = USUAL_SIDES[axis] * longest - side[axis]
        below = 0.5 if axis == 0 else 1.0
        low[axis] -= below * more
        high[axis] += (1.0 - below) * more
    return low, high


def initial_frame(points: np.ndarray, reading: PoseHypothesis, known: bool) -> Frame:
    """Return the frame of the visible part after the hypothesis's rotation; the identity for a known frame."""
    return Frame(center=np.zeros(3), scale=1.0) if known else unit_box_frame(points, reading.rotation)


def _clouds(points: np.ndarray, frames: Sequence[Frame]) -> Tensor:
    return torch.stack([torch.from_numpy(frame.to_unit(points)).float() for frame in frames])


def _screen_by_category(readings: Sequence[Candidates]) -> list[float]:
    """Screen the hypotheses of each category together; categories may have fewer models than are retrieved."""
    errors = [0.0] * len(readings)
    for category in dict.fromkeys(reading.category for reading in readings):
        rows = [row for row, reading in enumerate(readings) if reading.category == category]
        for row, error in zip(rows, _screen([readings[row] for row in rows]), strict=True):
            errors[row] = error
    return errors


def _screen(readings: Sequence[Candidates]) -> list[float]:
    """Return the lowest error of each hypothesis after a quick refinement of its best candidates, batched.

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
