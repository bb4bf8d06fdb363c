"""How well retrieval ranks: does the order by tokens foretell the order of errors after deformation and refinement?

For each target all of the database is deformed and refined to the end, not only what retrieval would have tried. The
true best is the model of the lowest error then. Orders: by token distance (as a fit), by the error
after feed-forward deformation (what a fit could go by at the cost of deforming everything, or of deforming the
100 nearest by tokens), and by the distance of the undeformed shape (which needs no network).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from scipy.stats import rankdata
from torch import Tensor

from kpred.evaluation.database_source import Progress
from kpred.evaluation.methods.method import FEED_FORWARD, REFINED
from kpred.evaluation.metrics.cloud_errors import CHUNK, cloud_errors
from kpred.evaluation.metrics.metric import CD, FRACTION, NO_UNIT, SEEN, UCD, Metric
from kpred.evaluation.tables.config import TableConfig
from kpred.evaluation.tables.packs import OpenPack
from kpred.evaluation.tables.scorer import Condition
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

    def sort_key(self, order: str) -> Float[np.ndarray, " models"]:
        """Return the key of an order of `ORDERS`, lowest first."""
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
        """Decide whether a model as good as the true best is in the first `top_k` of an order."""
        return bool(self.refined[self._rows(order)[:top_k]].min() <= NEARLY * self.refined.min())

    def correlation(self, order: str) -> float:
        """Spearman's rank correlation between what the order goes by and the refined error; 0 where all are equal."""
        one, other = rankdata(self.sort_key(order)), rankdata(self.refined)
        if np.ptp(one) == 0 or np.ptp(other) == 0:
            return 0.0
        return float(np.corrcoef(one, other)[0, 1])

    def _rows(self, order: str) -> np.ndarray:
        return self.sort_key(order).argsort(kind="stable")


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
    found = retrieve(encode_scan(cloud[None], network, partial), 0, store, pack.category, len(pack.sources), partial)
    place = {name: row for row, name in enumerate(pack.sources.model_ids)}
    undeformed = cloud_errors(cloud, pack.sources.points, partial).numpy()
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
    table: Table, pack: OpenPack, models: Mapping[str, Model], config: TableConfig, progress: Progress | None
) -> None:
    """Put the rankings of one pack's targets into a table."""
    with torch.inference_mode():
        total = len(pack.targets) * len(config.conditions) * len(models)
        done = 0
        for target in pack.targets:
            subject = Subject(pack.source.dataset, pack.category, target.model_id)
            for condition in config.conditions:
                cloud = condition.cloud(target)
                for name, model in models.items():
                    ranking = rank(cloud, pack, name, model[pack.category], config.refinement, condition.partial)
                    for series, value in scores_of(ranking, name, condition, config.numbers):
                        table.add(series, subject, value)
                    done += 1
                    if progress is not None:
                        progress(f"{pack.source.name}: all of the database", done, total)


def scores_of(ranking: Ranking, model: str, condition: Condition, top_k: Sequence[int]) -> list[tuple[Series, float]]:
    """List what a table holds of one ranking: how each order ranks, and the best errors of the order by tokens."""
    found: list[tuple[str, Metric, float]] = []
    for order in ORDERS:
        place = ranking.rank_of_best(order)
        for k in top_k:
            found.append((order, Metric(TRUE_BEST, SEEN, FRACTION, k), float(place <= k)))
            found.append((order, Metric(NEARLY_BEST, SEEN, FRACTION, k), float(ranking.nearly_best_in(order, k))))
        found.append((order, Metric(CORRELATION, SEEN, NO_UNIT), ranking.correlation(order)))
        found.append((order, Metric(RANK, SEEN, NO_UNIT), float(place)))
    error = UCD if condition.partial else CD
    for method, errors in ((FEED_FORWARD, ranking.feed_forward), (REFINED, ranking.refined)):
        found += [(method, Metric(error, top_k=k), float(errors[:k].min())) for k in top_k]
        found.append((method, Metric(error), float(errors.min())))
    return [(condition.series(model, method, metric), value) for method, metric, value in found]
