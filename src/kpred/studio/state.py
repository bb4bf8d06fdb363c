"""What a session shows after some gestures: the scan, the fit, and the shape as it was corrected. Immutable."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from threading import Lock

import numpy as np

from kpred.fitting.options import FitOptions
from kpred.fitting.pipeline import Timer, run_fit
from kpred.fitting.result import Candidate, Fit
from kpred.fitting.stages import Context
from kpred.ops.typing import Float
from kpred.studio.editable import corrected_fit, editable_shape, mirror_pairs
from kpred.studio.shape import Held, Place, Shape

_fitting = Lock()


def run_alone(points: Float[np.ndarray, "points 3"], context: Context, options: FitOptions) -> Fit:
    """Fit a scan; the fits of several sessions take turns, each with all threads.

    Raises:
        KpredError: it cannot be fitted; the sentence says why.
    """
    with _fitting:
        return run_fit(points, context, options, Timer())


@dataclass(frozen=True, eq=False)
class State:
    """The scan and its fit at one point of a session.

    Attributes:
        points: (N, 3) of the scan, its own frame and unit; context: networks and database; options: of the fit.
        searched: the fit that found the candidates; fit: that of the chosen model; shape: of its result.
        corrected: whether the shape was changed by hand since.
        pins: places of pinned keypoints, and sizes: typed lengths by part and axis, the scan's unit box.
    """

    points: Float[np.ndarray, "points 3"]
    context: Context
    options: FitOptions
    searched: Fit
    fit: Fit
    shape: Shape
    corrected: bool = False
    pins: Mapping[int, Place] = field(default_factory=dict)
    sizes: Mapping[tuple[int, int], float] = field(default_factory=dict)

    @classmethod
    def of(cls, points: Float[np.ndarray, "points 3"], context: Context, options: FitOptions) -> State:
        """Fit a scan.

        Raises:
            KpredError: it cannot be fitted; the sentence says why.
        """
        fit = run_alone(points, context, options)
        return cls(points, context, options, fit, fit, editable_shape(fit, options.structure))

    def fitted(self, context: Context, options: FitOptions, points: np.ndarray | None = None) -> State:
        """Fit again with other options or points; corrections by hand are dropped."""
        return State.of(self.points if points is None else points, context, options)

    def with_fit(self, fit: Fit) -> State:
        """Show the fit of another model; corrections by hand are dropped."""
        shape = editable_shape(fit, self.options.structure)
        return replace(self, fit=fit, shape=shape, corrected=False, pins={}, sizes={})

    def with_shape(self, shape: Shape) -> State:
        """Show a corrected shape."""
        return replace(self, shape=shape, corrected=True)

    @property
    def held(self) -> Held:
        """What stays while the rest is changed."""
        return Held(self.pins, self.sizes)

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """The models that the search found, best first."""
        return self.searched.candidates

    @cached_property
    def mirror_pairs(self) -> tuple[int, ...]:
        """The keypoint on the other side of each; -1: none."""
        return mirror_pairs(self.fit.placed.entry)

    @cached_property
    def result(self) -> Fit:
        """The fit with the mesh as it was corrected."""
        return corrected_fit(self.fit, self.shape, self.points) if self.corrected else self.fit

    @property
    def vertices(self) -> Float[np.ndarray, "vertices 3"]:
        """Vertices of the result, the scan's frame and unit."""
        return self.fit.frame.from_unit(self.shape.vertices)

    @property
    def keypoints(self) -> Float[np.ndarray, "keypoints 3"]:
        """Keypoints of the result, the scan's frame and unit."""
        return self.fit.frame.from_unit(self.shape.keypoints)

    def part_sizes(self, part: int) -> Float[np.ndarray, "3"]:
        """Measure width, height and depth of a part, or of the whole object; the scan's unit."""
        return self.shape.sizes(part) * self.fit.frame.scale
