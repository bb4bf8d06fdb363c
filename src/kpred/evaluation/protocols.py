"""Protocols: what is measured for one target against one database.

`full`: the whole surface is seen; networks for full shapes; Chamfer distance (CD). `partial`: a random plane hides a
share of the points while the frame stays that of the whole shape; networks for partial scans; distance from the seen
points to the result alone (UCD), and, of the same result, from the whole surface (metrics that end in `_whole`).

Metrics, each the best of the models compared:
    sampling_floor       two independent samples of the target: what even a perfect result would be charged
    undeformed_nearest   the true nearest database shape as it is, all of them compared
    no_learning          the nearest undeformed shapes, deformed by `NoLearning` with refinement from no displacement
    undeformed_retrieved the models retrieved by tokens, as they are
    feed_forward         models retrieved by tokens, deformed by the network's keypoints (the published protocol)
    refined              the same after keypoint refinement
    refined_cage         the same with a cage around the best of them refined too: what a fit gives by default
    oracle_...           the same with all of the database in place of the retrieved models
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import torch
from torch import Tensor

from kpred.database import Database
from kpred.evaluation.baselines import CHUNK, NoLearning, undeformed_errors
from kpred.evaluation.rows import CD, NO_LEARNING, RETRIEVED, UCD, UCD_WHOLE, UNDEFORMED, WHOLE, Score
from kpred.evaluation.targets import Target
from kpred.fitting import RefineConfig
from kpred.fitting.cage_refinement import with_cages
from kpred.fitting.candidates import Candidates, retrieve
from kpred.fitting.choice import order
from kpred.fitting.observation import observe
from kpred.nn import KPRed
from kpred.ops import chamfer_distance, squared_distances
from kpred.ops.typing import Float

FULL, PARTIAL = "full", "partial"


@dataclass(frozen=True, eq=False)
class Bench:
    """What targets of one category are measured against.

    Attributes:
        network: the learned model; database: where it searches; baseline: the same shapes for both baselines.
        top_k: numbers of models to compare; every number gets scores of its own.
        refinement: settings of the refinement, for the learned model and for the baseline alike.
        oracle: whether all of the database is deformed and compared too.
        baselines, learned: whether what needs no model, and what the model does, are measured: of several models on the
            same targets one is enough to measure the baselines beside.
    """

    network: KPRed
    database: Database
    baseline: NoLearning
    top_k: tuple[int, ...]
    refinement: RefineConfig
    oracle: bool = False
    baselines: bool = True
    learned: bool = True


def measure(target: Target, bench: Bench, protocol: str, occlusion: float = 0.0) -> list[Score]:
    """All scores of one target; what is measured is what `kpred.fit` does with `frame="known"` and this category."""
    cloud = target.visible(occlusion) if protocol == PARTIAL else target.points
    return measure_cloud(cloud, target, bench, protocol, occlusion)


def measure_cloud(
    cloud: Float[Tensor, "seen 3"], target: Target, bench: Bench, protocol: str, occlusion: float
) -> list[Score]:
    """All scores of one target of which `cloud` is seen, in the known frame; unit box."""
    partial = protocol == PARTIAL
    sheet = _Sheet(protocol, occlusion, target.points if partial else None)
    baseline = bench.baseline
    few = torch.arange(min(max(bench.top_k), len(baseline.points)))
    most = len(baseline.points) if bench.oracle else max(bench.top_k)
    if bench.baselines:
        undeformed = undeformed_errors(cloud, baseline.points, partial)
        sheet.floor(cloud, target.again)
        sheet.add(UNDEFORMED, float(undeformed.min()))
        if partial:
            whole = undeformed_errors(target.points, baseline.points, partial=True)
            sheet.add(UNDEFORMED + WHOLE, float(whole.min()), UCD_WHOLE)
        unmoved = baseline.candidates(cloud, undeformed, undeformed.argsort(stable=True)[:most], partial)
        sheet.best_refined(NO_LEARNING, unmoved, bench)
        if bench.oracle:
            sheet.add(f"oracle_{NO_LEARNING}", _best_of_all(unmoved, bench.refinement))
    if bench.learned:
        observation = observe(cloud[None], bench.network, partial)
        found = retrieve(observation, 0, bench.database, baseline.category, most, partial)
        nearest = found.take(few)
        sheet.best(RETRIEVED, replace(nearest, displacement=torch.zeros_like(nearest.displacement)), bench.top_k)
        sheet.best("feed_forward", nearest, bench.top_k)
        sheet.best_refined("refined", nearest, bench)
        if bench.refinement.has_cage(partial):
            sheet.best_with_cages("refined_cage", nearest, bench)
        if bench.oracle:
            sheet.add("oracle_feed_forward", _best_of_all(found, None))
            sheet.add("oracle_refined", _best_of_all(found, bench.refinement))
    return sheet.scores


class _Sheet:
    """Scores of one target under one protocol and occlusion."""

    def __init__(self, protocol: str, occlusion: float, whole: Tensor | None) -> None:
        self.protocol, self.occlusion, self.whole = protocol, occlusion, whole
        self.scores: list[Score] = []

    @property
    def distance(self) -> str:
        return CD if self.whole is None else UCD

    def add(self, metric: str, value: float, distance: str | None = None, top_k: int | None = None) -> None:
        distance = self.distance if distance is None else distance
        self.scores.append(Score(self.protocol, self.occlusion, metric, distance, top_k, value))

    def floor(self, cloud: Tensor, again: Tensor) -> None:
        if self.whole is None:
            self.add("sampling_floor", float(chamfer_distance(cloud[None], again[None])))
        else:
            self.add("sampling_floor", float(squared_distances(cloud[None], again[None]).mean()))

    def best(self, metric: str, candidates: Candidates, top_k: tuple[int, ...]) -> None:
        """The best of the first k candidates; they come nearest first."""
        errors = candidates.errors()
        for k in top_k:
            first = torch.arange(min(k, len(errors)))
            # The published protocol takes the lowest error; a refined partial scan's result is chosen as a fit does.
            refined = self.whole is not None and metric in ("refined", "refined_cage")
            row = torch.tensor(order(candidates.take(first), errors[first])[0]) if refined else errors[:k].argmin()
            self.add(metric, float(errors[row]), top_k=k)
            if self.whole is not None:
                # The model was chosen by what was seen; it is charged for what was not seen.
                squared = squared_distances(self.whole[None], candidates.take(row[None]).deformed())
                self.add(metric + WHOLE, float(squared.mean()), UCD_WHOLE, k)

    def best_refined(self, metric: str, candidates: Candidates, bench: Bench) -> None:
        """The best of the first k, refined as a fit of top k refines them: only the best few of them to the end."""
        for k in bench.top_k:
            first = torch.arange(min(k, len(candidates.points)))
            self.best(metric, candidates.refined(bench.refinement, first), (k,))

    def best_with_cages(self, metric: str, candidates: Candidates, bench: Bench) -> None:
        """The best of the first k, keypoints refined, then cages, as a fit of top k does."""
        for k in bench.top_k:
            refined = candidates.refined(bench.refinement, torch.arange(min(k, len(candidates.points))))
            caged, _, _ = with_cages(refined, refined.errors(), bench.database, bench.refinement)
            self.best(metric, caged, (k,))


def _best_of_all(candidates: Candidates, refinement: RefineConfig | None) -> float:
    """The lowest error of all candidates, each refined to the end."""
    best = float("inf")
    refinement = None if refinement is None else replace(refinement, finalists=CHUNK)
    for rows in torch.arange(len(candidates.points)).split(CHUNK):
        part = candidates.take(rows) if refinement is None else candidates.refined(refinement, rows)
        best = min(best, float(part.errors().min()))
    return best
