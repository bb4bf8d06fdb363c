"""Each candidate deformed to the scan by the simplest step that explains it: placed, sized, restructured, or free."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, TypeVar

import numpy as np
import torch

from kpred.fitting.candidates import Candidates
from kpred.fitting.expected_surface import expected_surfaces
from kpred.fitting.explanation import Deformation, Deformed, Explanation
from kpred.fitting.visibility import Visibility
from kpred.ops.worksharing import parallel_for
from kpred.refinement.config import Deform as Deform
from kpred.refinement.config import RefineConfig
from kpred.refinement.placement import Placement, fit_placement
from kpred.refinement.score import COSTS, Distances, Step, distances, spacing
from kpred.refinement.score_cpu import squared_diagonal
from kpred.refinement.structure_config import StructureConfig
from kpred.refinement.structure_fit import OUTSIDE, Evidence, fit_some, fit_structure

PLACED_POINTS = 384
"""Points of model and scan by which undeformed models are placed."""

COMPARED_POINTS = 512
"""Points of the scan by which candidates are compared; the result's error is of all."""

FINALISTS, FINALISTS_UNSEEN = 3, 6
"""Candidates that are deformed to the end, of whole scans and of those that lack something; others are estimates."""

OWN_SIZE_BONUS = 1.0
"""Fall of the log error that any other size than a model's own must bring, where the scan's unit is that of models and
the model explains the scan in its own size.
"""

EXPLAINED, EXPLAINED_WHOLE = 0.08, 0.04
"""Distance, unit box, to which a model explains a partial scan and a whole one: few do that are not the very thing. In
that of a partial scan there is doubt about what was seen.
"""

MAX_RESIZED = 1.3
"""A model is tried in its own size where the size that fits is within this factor of it."""

WHOLE = 0.95
"""Mean visibility from which on a scan counts as whole where candidates are compared."""

FLOOR_WEIGHT, FLOOR_DOUBT = 1.0, 0.02
"""Weight, beside the error, of the squared distance of the feet from a known floor; and how far they may be off it for
nothing, since samples end above the feet; unit box.
"""

Value = TypeVar("Value")


def deform_candidates(
    candidates: Candidates,
    visibility: Visibility,
    deform: Deform = "auto",
    *,
    refinement: RefineConfig | None = None,
    structure: StructureConfig | None = None,
    top_k: int | None = None,
    floor: float | None = None,
    unit: float | None = None,
) -> Deformed:
    """Deform every candidate to its scan, as far as `deform` allows and the scan demands.

    Args:
        candidates: retrieved; visibility: of places around the scan; floor: its height, scan's unit box.
        refinement: of keypoints, for `free`; structure: settings of the structure-keeping fit.
        top_k: deform so many of them, half of them the first, the others those that a sketch of the deformation brings
            nearest to the scan; None: all.
        unit: half the longest side of the scan's unit box, in the unit of the models' own sizes; None: not known.
    """
    config = structure or StructureConfig()
    chosen = candidates
    if top_k is not None and len(candidates.model_ids) > top_k:
        errors = np.array(sketch_errors(candidates, visibility, config, floor=floor))
        # A model that is the very thing is found by its tokens; among many, others can be bent to look like it.
        errors[: top_k // 2] = -np.inf
        chosen = candidates.take(torch.from_numpy(np.sort(np.argsort(errors, kind="stable")[:top_k])))
    work = _Work(chosen, visibility, config, floor, unit)
    if deform in ("paper", "free"):
        explanations = work.smooth(deform, refinement or RefineConfig())
    elif deform in ("none", "scale"):
        explanations = [work.simple(row, deform) for row in range(len(chosen.model_ids))]
    else:
        explanations = work.structured(simplest=deform == "auto")
    seen = float(np.mean([one.distances.seen for one in explanations]))
    return Deformed(chosen, visibility, tuple(explanations), seen)


def sketch_errors(
    candidates: Candidates, visibility: Visibility, structure: StructureConfig | None = None, floor: float | None = None
) -> list[float]:
    """Estimate the log error that each candidate would have, deformed; for arguments see `deform_candidates`."""
    return _Work(candidates, visibility, structure or StructureConfig(), floor, None).sketched()


@dataclass(frozen=True)
class _Placements:
    """Placements of one undeformed model: in its own size, if that is about the scan's; in one size; per axis."""

    own: Placement | None
    fitted: Placement
    per_axis: Placement


class _Work:
    """What all candidates of one hypothesis are deformed with."""

    def __init__(
        self,
        candidates: Candidates,
        visibility: Visibility,
        config: StructureConfig,
        floor: float | None,
        unit: float | None,
    ) -> None:
        self.candidates, self.visibility, self.config, self.unit = candidates, visibility, config, unit
        self.goal = np.ascontiguousarray(candidates.target.numpy())
        self.few = np.ascontiguousarray(self.goal[:: max(1, len(self.goal) // PLACED_POINTS)])
        self.spacing = spacing(self.goal)
        self.evidence = Evidence(self.goal, visibility, floor, self.spacing)
        self.points = candidates.points.numpy()
        start = candidates.deformed().numpy()
        self.start = expected_surfaces(start, self.goal) if candidates.partial else start
        self.models = [candidates.structure_model(row, config) for row in range(len(self.points))]

    @cached_property
    def placements(self) -> list[_Placements]:
        """Placements of every undeformed model."""
        return _each(self._placements, len(self.points))

    @cached_property
    def hidden(self) -> list[np.ndarray]:
        """How surely each point of every model, where the keypoints put it, was not seen."""
        rows = range(len(self.points))
        return [1.0 - self.visibility(self.start[row] + OUTSIDE * self.models[row].normals) for row in rows]

    def sketched(self) -> list[float]:
        """Estimate the log error of every candidate, deformed in a few rounds from where its keypoints put it."""
        config = self.config.sketch()
        return _each(lambda row: self._sketch(row, config), len(self.points))

    def _sketch(self, row: int, config: StructureConfig) -> float:
        """Estimate the log error of one candidate by the points alone that its sketch moves."""
        model, start = self.models[row], self.start[row]
        _, moved = fit_some(model, start, self.evidence, config)
        columns = model.thinned(config.points)
        visible = self.visibility(moved + OUTSIDE * columns.normals)
        unseen = 0.0
        if self.visibility.grid is not None:
            begun = start[columns.order]
            hidden = 1.0 - self.visibility(begun + OUTSIDE * columns.normals)
            unseen = float((hidden * np.square(moved - begun).sum(axis=1)).mean())
        spacings = self.spacing, len(start) / len(moved) * self._spacing(row, moved)
        measured = replace(distances(self.goal, spacings, moved, visible), unseen=unseen)
        return float(np.log(np.exp(measured.log_error()) + self._floor_error(model.feet[columns.order], moved)))

    def simple(self, row: int, step: Literal["none", "scale"]) -> Explanation:
        """Place the undeformed model, in its own size or the size that fits, or in one size per axis."""
        placed = self.placements[row]
        if step == "scale":
            return self._undeformed(row, step, placed.per_axis)
        fitted = self._undeformed(row, step, placed.fitted)
        if placed.own is None:
            return fitted
        own = self._undeformed(row, step, placed.own)
        explained = EXPLAINED_WHOLE if own.distances.seen > WHOLE else EXPLAINED
        if own.distances.log_error() > 2 * np.log(explained):
            return min(own, fitted, key=lambda one: one.score)
        return min(replace(own, score=own.score - OWN_SIZE_BONUS), fitted, key=lambda one: one.score)

    def _undeformed(self, row: int, step: Step, placement: Placement) -> Explanation:
        moved = placement(self.points[row]).astype(np.float32)
        return self._explanation(row, step, lambda model: placement(model.points), moved, placement)

    def smooth(self, step: Literal["free", "paper"], config: RefineConfig) -> list[Explanation]:
        """Deform all candidates by their keypoints, refined or as the network puts them."""
        moved = self.candidates if step == "paper" else self.candidates.refined(config)
        results, found = moved.deformed().numpy(), []
        for row, placed in enumerate(self.placements):
            displacement = moved.displacement[row].numpy().astype(np.float64)
            found.append(self._explanation(row, step, _keypoint_map(displacement), results[row], placed.fitted))
        stopped = torch.zeros(len(found), dtype=torch.bool) if moved.stopped is None else moved.stopped
        return [replace(one, final=not bool(stop)) for one, stop in zip(found, stopped, strict=True)]

    def structured(self, simplest: bool) -> list[Explanation]:
        """Deform all candidates by the structure-keeping fit, the best to the end; or by less where that is enough."""
        count = len(self.points)
        undeformed: list[list[Explanation]] = [[] for _ in range(count)]
        if simplest:
            undeformed = _each(lambda row: [self.simple(row, step) for step in ("none", "scale")], count)
        quick = _each(lambda row: self._structured(row, self.config.quick(), self._begin(row)), count)
        best = [min([*undeformed[row], quick[row]], key=lambda one: one.score) for row in range(count)]
        seen = float(np.mean([one.distances.seen for one in best]))
        finalists = FINALISTS if seen > WHOLE else FINALISTS_UNSEEN
        ahead = np.argsort([one.score for one in best], kind="stable")[:finalists]

        def finish(place: int) -> Explanation:
            row = int(ahead[place])
            full = self._structured(row, self.config.final(), self._begin(row), quick[row].points)
            return min([*undeformed[row], full], key=lambda one: one.score)

        found = [replace(one, final=False) for one in best]
        for row, one in zip(ahead, _each(finish, len(ahead)), strict=True):
            found[int(row)] = one
        return found

    def _begin(self, row: int) -> np.ndarray:
        """Compute where a model's points are first matched: by keypoints if parts are unseen, else in its shape."""
        if self.visibility.grid is None or not self.candidates.partial:
            begun: np.ndarray = self.placements[row].per_axis(self.points[row]).astype(np.float32)
            return begun
        return self.start[row]

    def _structured(
        self, row: int, config: StructureConfig, start: np.ndarray, matched: np.ndarray | None = None
    ) -> Explanation:
        model = self.models[row]
        found = fit_structure(model, start, self.evidence, config, matched)
        moved = model.moved(found)
        one = self._explanation(
            row, "structure", lambda points: found(points.points, points.parts), moved, self.placements[row].fitted
        )
        return replace(one, structure=found)

    def _explanation(
        self, row: int, step: Step, deformation: Deformation, moved: np.ndarray, placement: Placement
    ) -> Explanation:
        measured, log_error = self._measure(row, moved)
        return Explanation(step, deformation, moved, measured, log_error + COSTS[step], placement)

    def _measure(self, row: int, moved: np.ndarray) -> tuple[Distances, float]:
        """Measure distances between the scan and a deformed model, and the log error, with that of a known floor."""
        every = max(1, len(moved) // COMPARED_POINTS)
        visible = self.visibility(moved + OUTSIDE * self.models[row].normals)
        off = np.square(moved - self.start[row])[::every].sum(axis=1)
        unseen = float((self.hidden[row][::every] * off).mean())
        spacings = self.spacing, self._spacing(row, moved)
        measured = replace(distances(self.goal, spacings, moved, visible, every), unseen=unseen)
        return measured, float(np.log(np.exp(measured.log_error()) + self._floor_error(self.models[row].feet, moved)))

    def _floor_error(self, feet: np.ndarray, moved: np.ndarray) -> float:
        """Charge weighted points that do not stand on a known floor, unit box squared."""
        if self.evidence.floor is None or not feet.any():
            return 0.0
        gap = abs(float(feet @ moved[:, 1]) / float(feet.sum()) - self.evidence.floor)
        return FLOOR_WEIGHT * max(gap - FLOOR_DOUBT, 0.0) ** 2

    def _spacing(self, row: int, moved: np.ndarray) -> float:
        """Spacing of a result's points: that of the model's, which grows with its box."""
        model = self.models[row]
        return model.spacing * squared_diagonal(moved) / max(model.squared_diagonal, 1e-12)

    def _placements(self, row: int) -> _Placements:
        """Place the undeformed model in its own size, in one size, and in one size per axis."""
        every = max(1, len(self.points[row]) // PLACED_POINTS)
        points = np.ascontiguousarray(self.points[row][::every])
        begun = points if not self.candidates.partial else self.start[row][::every]
        visible = self.visibility(begun + OUTSIDE * self.models[row].normals[::every])
        start = Placement.identity()
        fitted = fit_placement(points, start, self.few, visible, per_axis=False, free_yaw=False, expected=begun)
        per_axis = fit_placement(points, fitted, self.few, visible, per_axis=True, free_yaw=False, expected=begun)
        return _Placements(self._own_size(row, points, fitted, visible, begun), fitted, per_axis)

    def _own_size(
        self, row: int, points: np.ndarray, fitted: Placement, visible: np.ndarray, begun: np.ndarray
    ) -> Placement | None:
        """Place a model in its own size, where that is about the scan's."""
        if self.unit is None or self.candidates.scales is None:
            return None
        size = np.full(3, float(self.candidates.scales[row]) / self.unit)
        if not 1 / MAX_RESIZED < size[0] / float(fitted.size.mean()) < MAX_RESIZED:
            return None
        start = replace(fitted, size=size)
        return fit_placement(
            points, start, self.few, visible, per_axis=False, free_yaw=False, free_size=False, expected=begun
        )


def _keypoint_map(displacement: np.ndarray) -> Deformation:
    return lambda model: model.points + model.basis @ displacement


def _each(work: Callable[[int], Value], count: int) -> list[Value]:
    """`work` of each row, on all threads."""
    found: list[Value | None] = [None] * count

    def some(first: int, last: int) -> None:
        for row in range(first, last):
            found[row] = work(row)

    parallel_for(some, count, count * 1_000_000)
    return found  # type: ignore[return-value]
