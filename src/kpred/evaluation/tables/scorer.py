"""Scoring of methods: all predict for the same points of a target, and their results are scored alike.

Protocols. `full`: the whole surface is seen, which methods know; Chamfer distance (CD). `partial`: a random plane
hides a fraction of the points while the frame stays that of the whole shape; distance from the seen points to the
result alone (UCD), and, of the same result, from the whole surface. References need no method:
    sampling_floor       a second sample of the target: the error of a perfect result
    undeformed_nearest   the truly nearest source as it is; for the whole surface of a partial target chosen anew
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, field

import torch

from kpred.errors import ConfigError
from kpred.evaluation.methods.method import NO_MODEL, Method, Prediction, Query, Searcher
from kpred.evaluation.methods.sources import Sources
from kpred.evaluation.metrics.cleanliness_measures import MEASURES
from kpred.evaluation.metrics.cloud_errors import cloud_errors
from kpred.evaluation.metrics.metric import CD, MESH, UCD, WHOLE, Metric
from kpred.evaluation.tables.table import Series
from kpred.evaluation.tables.targets import Target
from kpred.ops import chamfer_distance, squared_distances
from kpred.ops.typing import Float

FULL, PARTIAL = "full", "partial"
FLOOR, UNDEFORMED = "sampling_floor", "undeformed_nearest"


@dataclass(frozen=True)
class Condition:
    """How a target is seen: the protocol, and the fraction of its points that a plane hides."""

    protocol: str = FULL
    occlusion: float = 0.0

    @property
    def partial(self) -> bool:
        """Whether only distances from the target count."""
        return self.protocol == PARTIAL

    def series(self, model: str, method: str, metric: Metric) -> Series:
        """Make the series of one metric under this condition."""
        return Series(model, method, self.protocol, self.occlusion, metric)

    def cloud(self, target: Target) -> Float[torch.Tensor, "seen 3"]:
        """Return what methods see of a target, unit box."""
        return target.visible(self.occlusion) if self.partial else target.points


@dataclass(frozen=True, eq=False)
class Scorer:
    """Methods that are ready to search the sources of one category.

    Attributes:
        searchers: with the names of their models; references: sources of `undeformed_nearest`, None leaves references
            out; top_k, oracle: as in `Query`.
        seconds: of the processor until a row's last result, one for each target, by model and method.
    """

    searchers: tuple[tuple[str, Searcher], ...]
    references: Sources | None
    top_k: tuple[int, ...]
    oracle: bool = False
    seconds: dict[tuple[str, str], list[float]] = field(default_factory=dict)

    @torch.inference_mode()
    def score(
        self, target: Target, condition: Condition, cloud: Float[torch.Tensor, "seen 3"]
    ) -> list[tuple[Series, float]]:
        """Score all methods on one target of which `cloud` is seen, unit box."""
        query = Query(target.model_id, cloud, condition.partial, self.top_k, self.oracle)
        found = [] if self.references is None else list(_references(query, target, self.references, condition))
        for model, searcher in self.searchers:
            spent: dict[str, float] = {}
            for prediction, seconds in _timed(searcher.predict(query)):
                spent[prediction.method] = seconds
                found += [
                    (condition.series(model, prediction.method, metric), value)
                    for metric, value in measure(prediction, query, target)
                ]
            for method, seconds in spent.items():
                self.seconds.setdefault((model, method), []).append(seconds)
        return found


def _timed(predictions: Iterator[Prediction]) -> Iterator[tuple[Prediction, float]]:
    """Yield each prediction with the processor's seconds that all so far have taken, but not what is done with them."""
    spent, began = 0.0, time.process_time()
    for prediction in predictions:
        spent += time.process_time() - began
        yield prediction, spent
        began = time.process_time()


def prepare(methods: list[Method], sources: Sources) -> list[tuple[str, Searcher]]:
    """Prepare methods for some sources, each with its name.

    Raises:
        ModelError: a method does not know the category or a source.
    """
    with torch.inference_mode():
        return [(method.name, method.over(sources)) for method in methods]


def check_names(names: list[str]) -> None:
    """Refuse names that are empty or not unique.

    Raises:
        ConfigError: a name is empty or given twice.
    """
    if not names or not all(names):
        raise ConfigError("A table needs at least one model, and a name for each; give NAME=FOLDER.")
    for name in names:
        if names.count(name) > 1:
            raise ConfigError(f"Two models or methods are named {name}; name them apart.")


def measure(prediction: Prediction, query: Query, target: Target) -> Iterator[tuple[Metric, float]]:
    """Measure a result: its error, that from the whole surface of a partial target, and its cleanliness."""
    points, k = prediction.points[None], prediction.top_k
    error = prediction.error
    if query.partial:
        seen = float(squared_distances(query.cloud[None], points).mean()) if error is None else error
        yield Metric(UCD, top_k=k), seen
        # The result was chosen by the seen points alone.
        yield Metric(UCD, WHOLE, top_k=k), float(squared_distances(target.points[None], points).mean())
    else:
        yield Metric(CD, top_k=k), float(chamfer_distance(query.cloud[None], points)) if error is None else error
    if prediction.cleanliness is not None:
        values = prediction.cleanliness.to_json()
        for name, unit in MEASURES.items():
            value = values[name]
            if value is not None:
                yield Metric(name, MESH, unit, k), float(value)


def _references(query: Query, target: Target, sources: Sources, condition: Condition) -> Iterator[tuple[Series, float]]:
    again = Prediction(FLOOR, None, target.model_id, target.again)
    metric, floor = next(measure(again, query, target))
    yield condition.series(NO_MODEL, FLOOR, metric), floor
    nearest = sources.undeformed_errors(query.cloud, query.partial).min()
    yield condition.series(NO_MODEL, UNDEFORMED, metric), float(nearest)
    if query.partial:
        whole = cloud_errors(target.points, sources.points, partial=True).min()
        yield condition.series(NO_MODEL, UNDEFORMED, Metric(UCD, WHOLE)), float(whole)
