"""How well retrieval ranks: does the order by tokens foretell the order of errors after deformation and refinement?

For each target all of the database is deformed and refined to the end, not only what retrieval would have tried. The
true best is the model of the lowest error then. Orders that are judged: by token distance (what a fit goes by), by the
error after feed-forward deformation (what a fit could go by at the cost of deforming everything, or of deforming the
100 nearest by tokens), and by the distance of the undeformed shape (which needs no network).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from scipy.stats import rankdata
from torch import Tensor

from kpred.evaluation.searched import Progress
from kpred.evaluation.tables.baselines import CHUNK, undeformed_errors
from kpred.evaluation.tables.measuring import OpenPack, Plan, SourcePack, Store, open_pack
from kpred.evaluation.tables.protocols import PARTIAL
from kpred.evaluation.tables.rows import CD, UCD, UNIT
from kpred.evaluation.tables.table import Series, Subject, Table
from kpred.fitting import RefineConfig
from kpred.fitting.candidates import Candidates, retrieve
from kpred.fitting.encoding import encode_scan
from kpred.nn import KPRed, Model
from kpred.ops.typing import Float

ORDERS = ("tokens", "feed_forward_error", "feed_forward_error_of_100", "undeformed_distance")
PREFETCH = 100
"""Models, the nearest by tokens, that the order by feed-forward error of 100 sorts again; the others follow."""

TRUE_BEST, NEARLY_BEST = "true_best_in_top", "within_5_percent_of_best_in_top"
RANK, CORRELATION = "rank_of_true_best", "spearman"
REFINED, FEED_FORWARD = "refined", "feed_forward"
SHARE, NO_UNIT = "share", "1"

NEARLY = 1.05
"""Errors that differ by no more are equal: another sample of the same surfaces would change as much."""


@dataclass(frozen=True, eq=False)
class Ranking:
    """All M models of a database against one target, those nearest by tokens first.

    Attributes:
        token_distance, feed_forward, refined, undeformed: (M,) distance of tokens, and errors, unit box squared.
    """

    token_distance: Float[np.ndarray, " models"]
    feed_forward: Float[np.ndarray, " models"]
    refined: Float[np.ndarray, " models"]
    undeformed: Float[np.ndarray, " models"]

    def judged_by(self, order: str) -> Float[np.ndarray, " models"]:
        """What an order of `ORDERS` goes by, lowest first."""
        again = np.arange(len(self.refined), dtype=np.float64)
        again[:PREFETCH] = -1 / (1 + self.feed_forward[:PREFETCH])
        return {
            "tokens": self.token_distance,
            "feed_forward_error": self.feed_forward,
            "feed_forward_error_of_100": again,
            "undeformed_distance": self.undeformed,
        }[order]

    def rank_of_best(self, order: str) -> int:
        """Place of the true best in an order, 1 for the first."""
        return int(np.flatnonzero(self._rows(order) == self.refined.argmin())[0]) + 1

    def nearly_best_in(self, order: str, top_k: int) -> bool:
        """Whether a model as good as the true best is among the first `top_k` of an order."""
        return bool(self.refined[self._rows(order)[:top_k]].min() <= NEARLY * self.refined.min())

    def correlation(self, order: str) -> float:
        """Spearman's rank correlation between what the order goes by and the refined error; 0 where all are equal."""
        one, other = rankdata(self.judged_by(order)), rankdata(self.refined)
        if np.ptp(one) == 0 or np.ptp(other) == 0:
            return 0.0
        return float(np.corrcoef(one, other)[0, 1])

    def _rows(self, order: str) -> np.ndarray:
        return self.judged_by(order).argsort(kind="stable")


def rank(
    cloud: Float[Tensor, "seen 3"],
    pack: OpenPack,
    model_name: str,
    network: KPRed,
    refinement: RefineConfig,
    partial: bool,
) -> Ranking:
    """Deform and refine all of a database to one target (unit box, known frame)."""
    store = pack.stores[model_name]
    everything = len(pack.baseline.points)
    found = retrieve(encode_scan(cloud[None], network, partial), 0, store, pack.category, everything, partial)
    place = {name: row for row, name in enumerate(pack.baseline.model_ids)}
    undeformed = undeformed_errors(cloud, pack.baseline.points, partial).numpy()
    return Ranking(
        token_distance=np.asarray(found.distances),
        feed_forward=_errors(found, None),
        refined=_errors(found, replace(refinement, finalists=CHUNK)),
        undeformed=undeformed[[place[name] for name in found.model_ids]],
    )


def _errors(candidates: Candidates, refinement: RefineConfig | None) -> np.ndarray:
    parts = []
    for rows in torch.arange(len(candidates.points)).split(CHUNK):
        part = candidates.take(rows) if refinement is None else candidates.refined(refinement, rows)
        parts.append(part.errors())
    return torch.cat(parts).numpy()


def add_rankings(
    table: Table,
    source: SourcePack,
    models: Mapping[str, Model],
    databases: Mapping[str, Store],
    plan: Plan,
    progress: Progress | None,
    report: Callable[[str], None],
) -> str:
    """Put the rankings of one pack's targets into a table; returns a hash of what was searched.

    Raises:
        PackError, DatabaseError, ConfigError: see `kpred.evaluation.tables.measuring.open_pack`.
    """
    quiet = replace(plan, baselines=False)
    with open_pack(source, models, databases, quiet, progress, report) as pack, torch.inference_mode():
        total = len(pack.targets) * len(plan.steps) * len(models)
        done = 0
        for target in pack.targets:
            subject = Subject(source.dataset, pack.category, target.model_id)
            for protocol, occlusion in plan.steps:
                partial = protocol == PARTIAL
                cloud = target.visible(occlusion) if partial else target.points
                for name, model in models.items():
                    ranking = rank(cloud, pack, name, model[pack.category], plan.refinement, partial)
                    where = Series(name, "", protocol, occlusion, UCD if partial else CD, None)
                    for series, value in scores_of(ranking, where, plan.top_k):
                        table.add(series, subject, value)
                    done += 1
                    if progress is not None:
                        progress(f"{pack.name}: all of the database", done, total)
        return pack.searched


def scores_of(ranking: Ranking, where: Series, top_k: Sequence[int]) -> list[tuple[Series, float]]:
    """What a table holds of one ranking; `where` says of which model and protocol."""
    found: list[tuple[Series, float]] = []
    for order in ORDERS:
        place = ranking.rank_of_best(order)
        for k in top_k:
            hit = replace(where, method=f"{TRUE_BEST}_by_{order}", top_k=k, unit=SHARE)
            found.append((hit, float(place <= k)))
            near = replace(where, method=f"{NEARLY_BEST}_by_{order}", top_k=k, unit=SHARE)
            found.append((near, float(ranking.nearly_best_in(order, k))))
        correlation = replace(where, method=f"{CORRELATION}_by_{order}", unit=NO_UNIT)
        found.append((correlation, ranking.correlation(order)))
        found.append((replace(where, method=f"{RANK}_by_{order}", unit=NO_UNIT), float(place)))
    for method, errors in ((FEED_FORWARD, ranking.feed_forward), (REFINED, ranking.refined)):
        for k in top_k:
            found.append((replace(where, method=method, top_k=k, unit=UNIT), float(errors[:k].min())))
        found.append((replace(where, method=method, unit=UNIT), float(errors.min())))
    return found
