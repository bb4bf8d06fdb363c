"""Protocols: what is measured for one target against one database.

`full`: the whole surface is seen, and the fit is given the hint that it is; Chamfer distance (CD). `partial`: a random
plane hides a fraction of the points while the frame stays that of the whole shape; networks for partial scans; distance
from the seen points to the result alone (UCD), and, of the same result, from the whole surface (metrics that end in
`_whole`).

Metrics, each the best of the models compared:
    sampling_floor       two independent samples of the target: what even a perfect result would be charged
    undeformed_nearest   the true nearest database shape as it is, all of them compared
    no_learning          the nearest undeformed shapes, deformed by `NoLearning` with refinement from no displacement
    undeformed_retrieved the models retrieved by tokens, as they are
    feed_forward         models retrieved by tokens, deformed by the network's keypoints (the published protocol)
    refined              what `kpred.fit(deform="free")` delivers: keypoints refined
    structure            what `kpred.fit` delivers by default: the simplest explanation that keeps structure
    structure_without_hint   the same where the fit itself must find out that nothing is hidden; `full` alone
    oracle_...           the same with all of the database in place of the retrieved models

Of `undeformed_retrieved`, `refined` and `structure` at the largest top k, cleanliness is measured too
(`kpred.evaluation.tables.cleanliness_scores`).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import torch
from torch import Tensor

from kpred.database import Database
from kpred.evaluation.tables.baselines import CHUNK, NoLearning, undeformed_errors
from kpred.evaluation.tables.cleanliness_scores import cleanliness_scores
from kpred.evaluation.tables.known_frame import Delivered, deliver, retrieve_for, undeformed
from kpred.evaluation.tables.rows import CD, NO_LEARNING, RETRIEVED, UCD, UCD_WHOLE, UNDEFORMED, WHOLE, Score
from kpred.evaluation.tables.targets import Target
from kpred.fitting.candidates import Candidates
from kpred.fitting.deform import Deform
from kpred.fitting.options import FitOptions
from kpred.fitting.stages import Context
from kpred.fitting.visibility import Visibility
from kpred.nn import Model
from kpred.ops import chamfer_distance, squared_distances
from kpred.ops.typing import Float
from kpred.refinement.config import RefineConfig
from kpred.refinement.structure_config import StructureConfig

FULL, PARTIAL = "full", "partial"
FEED_FORWARD, REFINED, STRUCTURE, WITHOUT_HINT = "feed_forward", "refined", "structure", "structure_without_hint"


@dataclass(frozen=True, eq=False)
class Bench:
    """What targets of one category are measured against.

    Attributes:
        model: the learned networks; database: where they search; baseline: the same shapes for both baselines.
        top_k: numbers of models to compare; every number gets scores of its own.
        refinement: settings of the refinement, for the learned model and for the baseline alike.
        structure: settings of the structure-keeping deformation.
        oracle: whether all of the database is deformed and compared too.
        baselines, learned: whether what needs no model, and what the model does, are measured: of several models on the
            same targets one is enough to measure the baselines beside.
    """

    model: Model
    database: Database
    baseline: NoLearning
    top_k: tuple[int, ...]
    refinement: RefineConfig
    structure: StructureConfig = field(default_factory=StructureConfig)
    oracle: bool = False
    baselines: bool = True
    learned: bool = True

    def options(self, partial: bool | None, top_k: int) -> FitOptions:
        """Options of a fit in the known frame; `partial` is the hint that it is given."""
        return FitOptions(
            top_k=top_k,
            frame="known",
            partial=partial,
            clean=False,
            refinement=self.refinement,
            structure=self.structure,
        )


def measure(target: Target, bench: Bench, protocol: str, occlusion: float = 0.0) -> list[Score]:
    """Measure one target; what is measured is what `kpred.fit` does with `frame="known"` and this category."""
    cloud = target.visible(occlusion) if protocol == PARTIAL else target.points
    return measure_cloud(cloud, target, bench, protocol, occlusion)


def measure_cloud(
    cloud: Float[Tensor, "seen 3"], target: Target, bench: Bench, protocol: str, occlusion: float
) -> list[Score]:
    """Measure one target of which `cloud` is seen, in the known frame; unit box."""
    partial = protocol == PARTIAL
    sheet = _Sheet(protocol, occlusion, cloud, target.points if partial else None)
    if bench.baselines:
        _add_baselines(sheet, target, bench)
    if bench.learned:
        _add_learned(sheet, bench)
    return sheet.scores


def _add_baselines(sheet: _Sheet, target: Target, bench: Bench) -> None:
    baseline, cloud, partial = bench.baseline, sheet.cloud, sheet.whole is not None
    most = len(baseline.points) if bench.oracle else max(bench.top_k)
    errors = undeformed_errors(cloud, baseline.points, partial)
    sheet.floor(target.again)
    sheet.add(UNDEFORMED, float(errors.min()))
    if partial:
        whole = undeformed_errors(target.points, baseline.points, partial=True)
        sheet.add(UNDEFORMED + WHOLE, float(whole.min()), UCD_WHOLE)
    unmoved = baseline.candidates(cloud, errors, errors.argsort(stable=True)[:most], partial)
    for k in bench.top_k:
        # The best few alone are refined to the end, as in a fit.
        first = torch.arange(min(k, len(unmoved.points)))
        sheet.best(NO_LEARNING, unmoved.refined(bench.refinement, first), k)
    if bench.oracle:
        sheet.add(f"oracle_{NO_LEARNING}", _best_of_all(unmoved, bench.refinement))


def _add_learned(sheet: _Sheet, bench: Bench) -> None:
    context = Context(bench.model, bench.database, (bench.baseline.category,))
    partial = sheet.whole is not None
    most = len(bench.baseline.points) if bench.oracle else max(bench.top_k)
    tried = retrieve_for(sheet.cloud, context, bench.options(partial, most))
    found = tried.best.candidates
    unmoved = replace(found, displacement=torch.zeros_like(found.displacement))
    for k in bench.top_k:
        first = torch.arange(min(k, len(found.points)))
        row = sheet.best(RETRIEVED, unmoved.take(first), k)
        if k == max(bench.top_k):
            sheet.cleanliness(RETRIEVED, undeformed(found.model_ids[row], bench.database), k)
        sheet.best(FEED_FORWARD, found.take(first), k)
    _add_delivered(sheet, bench, found, tried.visibility, partial, {REFINED: "free", STRUCTURE: "auto"})
    if not partial:
        again = retrieve_for(sheet.cloud, context, bench.options(None, max(bench.top_k)))
        _add_delivered(sheet, bench, again.best.candidates, again.visibility, None, {WITHOUT_HINT: "auto"})
    if bench.oracle:
        sheet.add("oracle_feed_forward", _best_of_all(found, None))
        sheet.add("oracle_refined", _best_of_all(found, bench.refinement))


def _add_delivered(
    sheet: _Sheet,
    bench: Bench,
    candidates: Candidates,
    visibility: Visibility,
    partial: bool | None,
    methods: dict[str, Deform],
) -> None:
    """Add what fits of each top k deliver by each deformation, and how clean the result of the largest is."""
    for k in bench.top_k:
        first = candidates.take(torch.arange(min(k, len(candidates.points))))
        for metric, deform in methods.items():
            options = replace(bench.options(partial, k), deform=deform)
            result = deliver(first, visibility, bench.database, options)
            sheet.result(metric, result.points, k)
            if k == max(bench.top_k):
                sheet.cleanliness(metric, result, k)


class _Sheet:
    """Scores of one target under one protocol and occlusion.

    Attributes:
        cloud: (N, 3) what is seen; whole: (M, 3) the whole surface of a target that is not seen whole.
    """

    def __init__(self, protocol: str, occlusion: float, cloud: Tensor, whole: Tensor | None) -> None:
        self.protocol, self.occlusion, self.cloud, self.whole = protocol, occlusion, cloud, whole
        self.scores: list[Score] = []

    def add(self, metric: str, value: float, distance: str | None = None, top_k: int | None = None) -> None:
        """Add one error."""
        kind = (CD if self.whole is None else UCD) if distance is None else distance
        self.scores.append(Score(self.protocol, self.occlusion, metric, kind, top_k, value))

    def cleanliness(self, metric: str, result: Delivered, top_k: int) -> None:
        """Add what a result lost of its model's cleanliness."""
        self.scores += cleanliness_scores(result.cleanliness(), self.protocol, self.occlusion, metric, top_k)

    def floor(self, again: Tensor) -> None:
        """Add the error of a second sample of the target."""
        if self.whole is None:
            self.add("sampling_floor", float(chamfer_distance(self.cloud[None], again[None])))
        else:
            self.add("sampling_floor", float(squared_distances(self.cloud[None], again[None]).mean()))

    def best(self, metric: str, candidates: Candidates, top_k: int) -> int:
        """Add the lowest error of some candidates (the published protocol), and give its row."""
        errors = candidates.errors()
        row = int(errors.argmin())
        self.add(metric, float(errors[row]), top_k=top_k)
        if self.whole is not None:
            # The model was chosen by what was seen; it is charged for what was not seen.
            squared = squared_distances(self.whole[None], candidates.deformed()[row : row + 1])
            self.add(metric + WHOLE, float(squared.mean()), UCD_WHOLE, top_k)
        return row

    def result(self, metric: str, points: Float[Tensor, "points 3"], top_k: int) -> None:
        """Add the errors of one result."""
        if self.whole is None:
            self.add(metric, float(chamfer_distance(self.cloud[None], points[None])), top_k=top_k)
            return
        self.add(metric, float(squared_distances(self.cloud[None], points[None]).mean()), top_k=top_k)
        whole = float(squared_distances(self.whole[None], points[None]).mean())
        self.add(metric + WHOLE, whole, UCD_WHOLE, top_k)


def _best_of_all(candidates: Candidates, refinement: RefineConfig | None) -> float:
    """The lowest error of all candidates, each refined to the end."""
    best = float("inf")
    refinement = None if refinement is None else replace(refinement, finalists=CHUNK)
    for rows in torch.arange(len(candidates.points)).split(CHUNK):
        part = candidates.take(rows) if refinement is None else candidates.refined(refinement, rows)
        best = min(best, float(part.errors().min()))
    return best
