"""Objects of a raw room, with nothing given: which points are a chair, a table or a cabinet, and how surely."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch

from kpred.detection.crops import proposal_crops, turned_clouds
from kpred.detection.gravity import Gravity, find_directions
from kpred.detection.links import Links
from kpred.detection.networks import CATEGORIES, Detector, bundled_detector
from kpred.detection.propose import PreparedRoom, pair_odds, prepare_room, propose_objects, room_links
from kpred.detection.selection import select_proposals
from kpred.ops.rotations import Y_TO_Z, upright_rotation
from kpred.ops.typing import Float, Int

MIN_SCORE = 0.25
"""Least score of an object: probability of its category times the expected IoU with it."""

MARGIN = 0.8
"""Proposals are selected by a first score down to this fraction of the least one, and then scored again."""

SURE = 0.4
"""Objects above this score speak for an up direction, where there are two."""

MIN_POINTS = 64
"""Points of the scan that an object needs to be fitted."""

BATCH = 32


@dataclass(frozen=True, eq=False)
class DetectedObject:
    """One object found in a room.

    Attributes:
        category: chair, table or cabinet.
        score: probability of the category times the expected IoU, in [0, 1].
        quality: expected IoU of the points with those of one object.
        rows: (M,) rows of the room's points.
    """

    category: str
    score: float
    quality: float
    rows: Int[np.ndarray, " points"]


@dataclass(frozen=True, eq=False)
class Detection:
    """What was found in a room.

    Attributes:
        objects: the likeliest first.
        gravity: up direction, and the length of the scan's unit in metres.
        floor: height of the floor along `gravity.direction` at the origin, scan's unit; None without a floor.
        structure: (N,) points of floor, walls and ceiling.
    """

    objects: tuple[DetectedObject, ...]
    gravity: Gravity
    floor: float | None
    structure: np.ndarray


def detect_objects(
    points: Float[np.ndarray, "points 3"],
    up: str = "auto",
    detector: Detector | None = None,
    min_score: float = MIN_SCORE,
    metres: float | None = None,
) -> Detection:
    """Find the furniture of a room.

    Args:
        points: (N, 3) in m, cm, mm, or in the unit of `metres`; rows that are not finite belong to nothing.
        up: the up axis (x, y, z, -x, -y, -z); `auto` finds the up direction, which need not be an axis.
        detector: trained networks; None means bundled.
        min_score: least score of an object.
        metres: length of the unit, where it is known.
    """
    finite = np.flatnonzero(np.isfinite(points).all(axis=1))
    if len(finite) < MIN_POINTS:
        axis = "z" if up == "auto" else up
        return Detection(
            (), Gravity(upright_rotation(axis)[1], axis, np.eye(3), 1.0), None, np.zeros(len(points), dtype=bool)
        )
    networks = detector or bundled_detector()
    directions = find_directions(points[finite], up, metres)
    tried = [_detect_upright(points, gravity, networks, min_score) for gravity in directions]
    return max(tried, key=lambda found: sum(item.score for item in found.objects if item.score > SURE))


def _detect_upright(
    points: Float[np.ndarray, "points 3"], gravity: Gravity, networks: Detector, min_score: float
) -> Detection:
    """Find the furniture of a room whose up direction is known."""
    solid = np.where(np.isfinite(points).all(axis=1, keepdims=True), points, np.nan)
    origin = np.nanmedian(solid, axis=0)
    to_upright = Y_TO_Z @ upright_rotation(gravity.axis) @ gravity.rotation
    room = prepare_room((solid - origin) @ to_upright.T * gravity.metres)
    odds = pair_odds(room, networks.pairs) if room.pieces is not None else np.zeros(0)
    links = room_links(room, odds)
    proposals = sorted(propose_objects(room, odds), key=sorted)
    probability, quality = score_proposals(room, links, proposals, networks)
    chosen = select_proposals(
        room, proposals, probability[:, :-1].max(axis=1, initial=0.0) * quality, MARGIN * min_score
    )
    probability, quality = score_proposals(room, links, [pieces for _, pieces in chosen], networks, turns=4)
    objects = []
    for (_, pieces), chances, overlap in zip(chosen, probability, quality, strict=True):
        rows = _points_of(room, pieces)
        category = int(chances[:-1].argmax())
        score = float(chances[category] * overlap)
        if len(rows) >= MIN_POINTS and score >= min_score:
            objects.append(DetectedObject(CATEGORIES[category], score, float(overlap), rows))
    objects.sort(key=lambda item: -item.score)
    floor = None
    if room.structure.found:
        place = origin + np.linalg.inv(to_upright) @ [0.0, 0.0, room.structure.plane[2] / gravity.metres]
        floor = float(place @ gravity.direction)
    structure = np.zeros(len(points), dtype=bool)
    owned = room.grid.owner >= 0
    structure[owned] = room.structure.mask[room.grid.owner[owned]]
    return Detection(tuple(objects), gravity, floor, structure)


def score_proposals(
    room: PreparedRoom, links: Links, proposals: Sequence[frozenset[int]], detector: Detector, turns: int = 1
) -> tuple[Float[np.ndarray, "proposals answers"], Float[np.ndarray, " proposals"]]:
    """Predict probabilities of the categories and, last, of none; and the IoU with one object, of each proposal.

    Args:
        turns: average over so many samples of points, turned by quarter turns.
    """
    if not proposals:
        return np.zeros((0, len(CATEGORIES) + 1)), np.zeros(0)
    total = np.zeros((len(proposals), len(CATEGORIES) + 2))
    for turn in range(turns):
        clouds, facts = proposal_crops(room.voxels, links, proposals, turn)
        parts = torch.from_numpy(turned_clouds(clouds, turn)).split(BATCH), torch.from_numpy(facts).split(BATCH)
        answers = []
        with torch.inference_mode():
            for part, whole in zip(*parts, strict=True):
                logits, quality = detector.proposals(part, whole)
                answers.append(torch.cat([logits.softmax(dim=1), quality.sigmoid()[:, None]], dim=1))
        total += torch.cat(answers).double().numpy() / turns
    return total[:, :-1], total[:, -1]


def _points_of(room: PreparedRoom, pieces: frozenset[int]) -> np.ndarray:
    wanted = np.zeros(int(room.voxels.segment.max()) + 2, dtype=bool)
    wanted[list(pieces)] = True
    inside = wanted[room.voxels.segment]
    owner = room.grid.owner
    return np.flatnonzero((owner >= 0) & inside[owner])
