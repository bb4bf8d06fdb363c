"""How retrieval is judged: laws of a ranking, and agreement with the oracle of the protocols."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import spearmanr

from kpred.evaluation.metrics.metric import CD, UCD, Metric
from kpred.evaluation.tables.config import TableConfig
from kpred.evaluation.tables.make_table import make_table
from kpred.evaluation.tables.ranking import NEARLY_BEST, ORDERS, RANK, TRUE_BEST, Ranking, scores_of
from kpred.evaluation.tables.scorer import PARTIAL, Condition
from kpred.nn import Model


def _ranking(rng: np.random.Generator, models: int = 30) -> Ranking:
    return Ranking(np.sort(rng.random(models)), rng.random(models), rng.random(models) + 0.1, rng.random(models))


def test_an_order_by_the_error_itself_is_perfect_and_its_reverse_is_not(rng: np.random.Generator) -> None:
    error = np.sort(rng.random(30))
    perfect = Ranking(error, error, error, error[::-1].copy())
    assert perfect.rank_of_best("tokens") == 1
    assert perfect.correlation("tokens") == pytest.approx(1)
    assert perfect.rank_of_best("undeformed_distance") == 30
    assert perfect.correlation("undeformed_distance") == pytest.approx(-1)


def test_correlation_is_that_of_scipy_and_ties_say_nothing(rng: np.random.Generator) -> None:
    ranking = _ranking(rng)
    for order in ORDERS:
        assert ranking.correlation(order) == pytest.approx(spearmanr(ranking.sort_key(order), ranking.refined)[0])
    assert replace(ranking, feed_forward=np.ones(30)).correlation("feed_forward_error") == 0


def test_the_true_best_is_in_every_top_from_its_rank_on(rng: np.random.Generator) -> None:
    for _ in range(20):
        ranking = _ranking(rng)
        scores = scores_of(ranking, "m", Condition(), range(1, 31))
        found = {(one.method, one.metric.name, one.metric.top_k): value for one, value in scores}
        for order in ORDERS:
            place = found[order, RANK, None]
            hits = [found[order, TRUE_BEST, k] for k in range(1, 31)]
            assert hits == [float(k >= place) for k in range(1, 31)]
            near = [found[order, NEARLY_BEST, k] for k in range(1, 31)]
            assert near == sorted(near)
            assert all(a >= b for a, b in zip(near, hits, strict=True))
        refined = [found["refined", CD, k] for k in range(1, 31)]
        assert refined == sorted(refined, reverse=True)
        assert refined[-1] == found["refined", CD, None] == ranking.refined.min()


def test_the_oracle_is_that_of_the_bench(packs: dict[str, Path], model: Model) -> None:
    settings = {"limit": 2, "occlusions": (0.5,)}
    table = make_table([packs["chair"]], {"m": model}, TableConfig("oracle", top_k=(1, 9), **settings))
    bench = make_table([packs["chair"]], {"m": model}, TableConfig("all", top_k=(4,), oracle=True, **settings))
    for condition in (Condition(), Condition(PARTIAL, 0.5)):
        error = UCD if condition.partial else CD
        for method in ("refined", "feed_forward"):
            wanted = bench.cell(condition.series("m", f"oracle_{method}", Metric(error)), "generated", "chair")
            for top_k in (9, None):
                found = table.cell(condition.series("m", method, Metric(error, top_k=top_k)), "generated", "chair")
                assert found is not None and wanted is not None
                assert found.value == pytest.approx(wanted.value, rel=1e-5)
    hits = [values for one, values in table.values.items() if (one.metric.name, one.metric.top_k) == (TRUE_BEST, 9)]
    assert hits and all(set(values.values()) == {1.0} for values in hits)


def test_sorting_the_nearest_again_leaves_the_others_where_they_are(rng: np.random.Generator) -> None:
    ranking = _ranking(rng, 150)
    rows = ranking.sort_key("feed_forward_error_of_100").argsort(kind="stable")
    assert rows[:100].tolist() == ranking.feed_forward[:100].argsort(kind="stable").tolist()
    assert rows[100:].tolist() == list(range(100, 150))
