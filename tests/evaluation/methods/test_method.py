"""The interface of methods: whatever retrieves and deforms is measured alike, and beside the package's own."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
import torch

from kpred.errors import ConfigError, ModelError, PackError
from kpred.evaluation.methods.kp_red import KpRedMethod
from kpred.evaluation.methods.method import Method, Prediction, Query, best_of_first
from kpred.evaluation.methods.sources import Sources
from kpred.evaluation.metrics.metric import CD, UCD, WHOLE, Metric
from kpred.evaluation.tables.config import TableConfig
from kpred.evaluation.tables.make_table import make_table
from kpred.evaluation.tables.scorer import PARTIAL, Condition
from kpred.nn import Model
from kpred.shapes.pack import MeshPack


@dataclass(frozen=True)
class _Copy:
    """Predicts every target by itself, after a wrong first answer."""

    name: str = "copy"
    provenance: dict[str, Any] = field(default_factory=lambda: {"made": "here"})

    def over(self, sources: Sources):
        return self._Searcher(sources)

    @dataclass(frozen=True)
    class _Searcher:
        sources: Sources

        def predict(self, query: Query) -> Iterator[Prediction]:
            results = torch.stack([0.5 * query.cloud, query.cloud])
            yield from best_of_first("copied", query, self.sources.model_ids[:2], results)


def test_any_method_is_measured_best_of_the_first_k(packs: dict[str, Path]) -> None:
    assert isinstance(_Copy(), Method)
    table = make_table([packs["chair"]], {}, TableConfig(top_k=(1, 5)), methods=[_Copy()])
    values = {k: table.values[Condition().series("copy", "copied", Metric(CD, top_k=k))] for k in (1, 5)}
    assert set(values[5].values()) == {0.0}
    assert min(values[1].values()) > 0
    assert {one.method for one in table.values if not one.model} == {
        "sampling_floor",
        "undeformed_nearest",
        "no_learning",
    }
    assert table.header["models"] == {"copy": {"made": "here"}}


def test_a_partial_result_is_measured_from_the_whole_surface_too(packs: dict[str, Path]) -> None:
    table = make_table([packs["chair"]], {}, TableConfig("partial", occlusions=(0.5,), top_k=(2,)), methods=[_Copy()])
    condition = Condition(PARTIAL, 0.5)
    seen = table.values[condition.series("copy", "copied", Metric(UCD, top_k=2))]
    whole = table.values[condition.series("copy", "copied", Metric(UCD, WHOLE, top_k=2))]
    assert set(seen.values()) == {0.0}
    assert min(whole.values()) > 0


def test_the_best_of_the_first_k_has_the_lowest_error_of_them(generator: torch.Generator) -> None:
    cloud = torch.rand(50, 3, generator=generator)
    results = cloud + torch.tensor([0.3, 0.2, 0.1])[:, None, None]
    query = Query("t", cloud, False, (1, 2, 3))
    found = list(best_of_first("m", query, ("a", "b", "c"), results))
    assert [(one.top_k, one.model_id) for one in found] == [(1, "a"), (2, "b"), (3, "c")]
    assert [one.error for one in found] == sorted((one.error or 0.0 for one in found), reverse=True)


def test_sources_build_one_database_for_each_model(packs: dict[str, Path], model: Model) -> None:
    pack = MeshPack.load(packs["chair"])
    with Sources.of_pack(pack, "p", 0, pytest.fail) as sources:
        store = sources.database(model)
        assert sources.database(model) is store
        assert set(store.model_ids("chair")) == set(sources.model_ids)
        again = Sources.of_databases("chair", {"m": model}, {"m": store})
        assert again.database(model) is store
        # A database keeps points on a grid.
        order = [sources.model_ids.index(name) for name in again.model_ids]
        torch.testing.assert_close(again.points, sources.points[order], atol=1e-3, rtol=0)


def test_refusals(packs: dict[str, Path], model: Model) -> None:
    chair = [packs["chair"]]
    with pytest.raises(ConfigError, match="named copy; name them apart"):
        make_table(chair, {}, TableConfig(), methods=[_Copy(), _Copy()])
    with pytest.raises(ConfigError, match="at least one model"):
        make_table(chair, {}, TableConfig())
    with pytest.raises(PackError, match="no shape is in the split 'nope'"):
        make_table(chair, {}, TableConfig(split="nope"), methods=[_Copy()])
    tables_only = Model("tables", {"table": model["table"]})
    with pytest.raises(ModelError, match="chair"):
        make_table(chair, {}, TableConfig(), methods=[KpRedMethod("refined", tables_only)])
