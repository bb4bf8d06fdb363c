"""A batch of scans gives what each scan gives alone."""

import numpy as np
import pytest
import torch
from batched_fits import ModelTable, ScanBatch

from kpred.database import Database
from kpred.fitting.candidates import Candidates, retrieve
from kpred.fitting.defaults import resolve_database, resolve_model
from kpred.fitting.encoding import encode_scan
from kpred.nn import Model
from kpred.ops import sample_surface
from kpred.ops.frames import unit_box_frame
from kpred.refinement.config import RefineConfig
from kpred.synthetic.generator import generate

SCANS, TOP = 3, 7


@pytest.fixture(scope="module")
def bundled() -> tuple[Model, Database]:
    return resolve_model(None), resolve_database(None)


@pytest.fixture(scope="module")
def scans() -> torch.Tensor:
    generator = torch.Generator().manual_seed(0)
    found = []
    for mesh in generate("chair", SCANS, seed=77):
        vertices, faces = torch.from_numpy(mesh.vertices), torch.from_numpy(mesh.faces).long()
        cloud = sample_surface(vertices, faces, 1024, generator)[0].double().numpy()
        found.append(torch.from_numpy(unit_box_frame(cloud).to_unit(cloud)).float())
    return torch.stack(found)


def _table(database: Database) -> ModelTable:
    ids = database.model_ids("chair")
    arrays = database.candidates("chair", ids)
    tokens = np.stack([database.entry(name).tokens for name in ids])
    return ModelTable(*(torch.from_numpy(np.asarray(a, np.float32)) for a in (tokens, *_fields(arrays))))


def _fields(arrays: object) -> list[np.ndarray]:
    return [getattr(arrays, name) for name in ("keypoints", "points", "point_basis")]


@pytest.mark.parametrize("partial", [False, True])
def test_a_batch_gives_what_each_scan_gives_alone(
    bundled: tuple[Model, Database], scans: torch.Tensor, partial: bool
) -> None:
    model, database = bundled
    clouds = scans[:, scans[0, :, 2].argsort()[:600]] if partial else scans
    network, ids = model["chair"], database.model_ids("chair")
    together = ScanBatch.retrieved(clouds, network, _table(database), TOP, partial)
    config = RefineConfig(points=256, finalists=3, reflection=0.0, free_space=0.0)
    feed_forward, refined = together.errors(), together.refined(config)
    for row, cloud in enumerate(clouds):
        alone: Candidates = retrieve(encode_scan(cloud[None], network, partial), 0, database, "chair", TOP, partial)
        assert tuple(ids[i] for i in together.rows[row]) == alone.model_ids
        np.testing.assert_allclose(together.distances[row], alone.distances, rtol=1e-4)
        torch.testing.assert_close(feed_forward[row], alone.errors(), rtol=1e-3, atol=1e-7)
        better = alone.refined(config)
        torch.testing.assert_close(refined.errors()[row], better.errors(), rtol=2e-2, atol=1e-6)
        torch.testing.assert_close(
            refined.errors(max_points=200)[row], better.errors(max_points=200), rtol=2e-2, atol=1e-6
        )
        assert refined.errors()[row].isfinite().sum() == config.most_finalists(partial)


def test_few_models_are_all_refined_to_the_end(bundled: tuple[Model, Database], scans: torch.Tensor) -> None:
    model, database = bundled
    table = _table(database)
    batch = ScanBatch.retrieved(scans, model["chair"], table, 2, partial=False)
    config = RefineConfig(points=256, finalists=3)
    assert (batch.refined(config).errors().mean(1) < batch.errors().mean(1)).all()
    assert batch.rows.shape == (SCANS, 2)
    one = batch.take(torch.zeros(SCANS, 1, dtype=torch.long))
    torch.testing.assert_close(one.errors()[:, 0], batch.errors()[:, 0])
