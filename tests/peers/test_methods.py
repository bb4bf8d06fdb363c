"""The bench of methods: its numbers are those of the package's own evaluation, whatever the method."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest
import torch
from torch import Tensor

from kpred.errors import ConfigError, ModelError, PackError
from kpred.evaluation import evaluate
from kpred.evaluation.methods import (
    Explanation,
    Instance,
    KpRedMethod,
    Method,
    NoLearningMethod,
    Sources,
    UndeformedMethod,
    evaluate_methods,
)
from kpred.evaluation.tables.rows import UNIT, Row
from kpred.nn import Model
from kpred.shapes.pack import MeshPack

OWN = ("undeformed_nearest", "no_learning", "feed_forward", "refined", "structure")


@pytest.fixture(scope="module")
def methods(model: Model) -> list[Method]:
    return [
        UndeformedMethod(),
        NoLearningMethod(),
        KpRedMethod("feed_forward", model),
        KpRedMethod("refined", model, "free"),
        KpRedMethod("structure", model, "auto"),
    ]


def _key(row: Row) -> tuple[object, ...]:
    return (row.dataset, row.category, row.protocol, row.occlusion, row.metric, row.distance, row.top_k)


@pytest.mark.parametrize("occlusions", [None, (0.5,)])
def test_own_methods_score_what_the_evaluation_says(
    packs: dict[str, Path], model: Model, methods: list[Method], occlusions: tuple[float, ...] | None
) -> None:
    protocol = "full" if occlusions is None else "partial"
    chair = [packs["chair"]]
    wanted = evaluate(chair, model, top_k=(1, 4), protocol=protocol, occlusions=occlusions or (0.0,), limit=2)
    rows, _ = evaluate_methods(chair, methods, top_k=(1, 4), occlusions=occlusions, limit=2)
    values = {_key(row): row for row in wanted if row.metric.removesuffix("_whole") in OWN and row.unit == UNIT}
    values = {key: row for key, row in values.items() if not key[4].startswith("undeformed_nearest_whole")}
    rows = [row for row in rows if row.metric != "undeformed_nearest_whole"]
    assert {_key(row) for row in rows} == set(values)
    for row in rows:
        if row.metric.startswith(("refined", "structure")) and row.top_k == 1:
            # Of fewer candidates it is the one that the fit of all ranks highest, not a fit of its own.
            continue
        # A database keeps points on a grid; the sources of the bench are as they were sampled.
        assert row.value == pytest.approx(values[_key(row)].value, rel=2e-3)
        assert row.n == values[_key(row)].n
        assert row.database_models == values[_key(row)].database_models


@dataclass(frozen=True)
class _Oracle:
    """Explains every target by itself, after a wrong first answer."""

    name: str = "oracle"
    ranked: bool = True

    def over(self, sources: Sources):
        return self._Searcher(sources)

    @dataclass(frozen=True)
    class _Searcher:
        sources: Sources

        def explain(self, target: Tensor, top_k: int, partial: bool) -> Explanation:
            return Explanation(self.sources.model_ids[:2], torch.stack([0.5 * target, target])[:top_k])


def test_any_method_is_measured_best_of_the_first_k(packs: dict[str, Path]) -> None:
    assert isinstance(_Oracle(), Method)
    rows, instances = evaluate_methods([packs["chair"]], [UndeformedMethod(), _Oracle()], top_k=(1, 5))
    value = {(row.metric, row.top_k): row.value for row in rows}
    assert value["oracle", 5] == 0
    assert value["oracle", 1] > 0
    assert ("undeformed_nearest", None) in value
    ids = [str(name) for name in MeshPack.load(packs["chair"]).model_id]
    sources = [name for i, name in enumerate(ids) if i % 4 != 3]
    chosen: Callable[[int], set[str]] = lambda k: {  # noqa: E731
        i.model_id for i in instances if (i.score.metric, i.score.top_k) == ("oracle", k)
    }
    assert chosen(1) == {sources[0]}
    assert chosen(5) == {sources[1]}


def test_rows_are_means_of_the_instances(packs: dict[str, Path]) -> None:
    rows, instances = evaluate_methods(list(packs.values()), [UndeformedMethod()])
    by_category: dict[str, list[Instance]] = {}
    for instance in instances:
        by_category.setdefault(instance.category, []).append(instance)
    for row in rows:
        single = instances if row.category == "all" else by_category[row.category]
        assert row.value == pytest.approx(sum(i.score.value for i in single) / len(single))
        assert len({i.target for i in single}) == row.n


def test_refusals(packs: dict[str, Path], model: Model) -> None:
    chair = [packs["chair"]]
    with pytest.raises(ConfigError, match="one name"):
        evaluate_methods(chair, [UndeformedMethod(), UndeformedMethod()])
    with pytest.raises(ConfigError, match="top_k"):
        evaluate_methods(chair, [UndeformedMethod()], top_k=(0,))
    with pytest.raises(ConfigError, match="Occlusions"):
        evaluate_methods(chair, [UndeformedMethod()], occlusions=(0.99,))
    with pytest.raises(PackError, match="no shape is in the split 'nope'"):
        evaluate_methods(chair, [UndeformedMethod()], split="nope")
    tables_only = Model("tables", {"table": model["table"]})
    with pytest.raises(ModelError, match="chair"):
        evaluate_methods(chair, [KpRedMethod("refined", tables_only)])
