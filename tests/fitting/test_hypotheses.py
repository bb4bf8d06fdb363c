"""Readings of a scan: what was read once with all points need not be read again."""

import numpy as np
import pytest
import torch

from kpred.database import Database
from kpred.fitting import hypotheses as module
from kpred.fitting.fit_scan import worth_trying
from kpred.fitting.hypotheses import Search, hypotheses
from kpred.fitting.placement import placements
from kpred.fitting.resources import as_database, as_model
from kpred.nn import Model
from kpred.ops import sample_surface
from kpred.shapes.synthetic.generator import generate


@pytest.fixture(scope="module")
def search() -> Search:
    model: Model = as_model(None)
    database: Database = as_database(None)
    return Search(model, database, top_k=3, frame_known=False)


@pytest.mark.parametrize("partial", [False, True])
def test_the_best_reading_is_not_read_twice(search: Search, partial: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = generate("chair", 1, seed=5)[0]
    vertices, faces = torch.from_numpy(mesh.vertices).float(), torch.from_numpy(mesh.faces).long()
    points = sample_surface(vertices, faces, 2048, torch.Generator().manual_seed(0))[0].double().numpy()
    readings = worth_trying(placements(points, "y", None, search.model.recognizer, search.model.categories), False)[:3]
    seen = []
    observe = module.observe
    monkeypatch.setattr(module, "observe", lambda clouds, *rest: seen.append(clouds.shape[1]) or observe(clouds, *rest))
    first = hypotheses(points, readings[:1], search, partial=False)
    again = hypotheses(points, readings, search, partial)
    before = len(seen)
    cheaper = hypotheses(points, readings, search, partial, before=first)
    assert again[0].category == cheaper[0].category == "chair"
    np.testing.assert_array_equal(again[0].frame.matrix(), cheaper[0].frame.matrix())
    assert again[0].candidates.model_ids == cheaper[0].candidates.model_ids
    torch.testing.assert_close(again[0].candidates.displacement, cheaper[0].candidates.displacement, rtol=0, atol=1e-5)
    # A full reading says nothing of a partial one.
    assert (2048 in seen[before:]) == (partial or not first[0].is_read_as(again[0]))
