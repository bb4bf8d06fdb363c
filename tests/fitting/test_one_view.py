"""A model of the database seen from one side: where it is known what was seen, it comes back first and undeformed."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.spatial import cKDTree

import kpred
from kpred.database import Entry
from kpred.fitting.candidates import Candidates
from kpred.fitting.defaults import resolve_database, resolve_model
from kpred.fitting.deform import deform_candidates
from kpred.fitting.explanation import ModelPoints
from kpred.fitting.selection import rank_candidates
from kpred.fitting.visibility import GRID_SIZE, REACH, Visibility
from kpred.ops import depth_scan, sample_surface

CATEGORIES = ("chair", "table", "cabinet")
CAMERA = torch.tensor([1.8, 1.8, 3.1])
"""In front, to the right and above, unit boxes."""


def _view(entry: Entry) -> tuple[np.ndarray, np.ndarray, torch.Tensor]:
    """Vertices, samples of all surface, and what the camera sees of it; unit box."""
    vertices = entry.frame.to_unit(entry.mesh.vertices.astype(np.float64))
    faces, generator = torch.as_tensor(np.array(entry.mesh.faces)).long(), torch.Generator().manual_seed(0)
    view = depth_scan(torch.from_numpy(vertices).float(), faces, CAMERA, 2048, generator=generator)
    return vertices, sample_surface(torch.from_numpy(vertices), faces, 20_000, generator)[0].numpy(), view


def _true_visibility(surface: np.ndarray, view: torch.Tensor) -> Visibility:
    """Fraction of the surface around each node of the grid that was seen."""
    seen = cKDTree(view.numpy()).query(surface)[0] < 0.05
    line = np.linspace(-REACH, REACH, GRID_SIZE)
    nodes = np.stack(np.meshgrid(line, line, line, indexing="ij"), axis=-1).reshape(-1, 3)
    distance, index = cKDTree(surface).query(nodes, k=64)
    weight = np.exp(-((distance / 0.15) ** 2)) + 1e-9
    grid = (weight * seen[index]).sum(axis=1) / weight.sum(axis=1)
    return Visibility(grid.reshape(GRID_SIZE, GRID_SIZE, GRID_SIZE).astype(np.float32))


def _candidates(database: kpred.Database, category: str, model_ids: list[str], view: torch.Tensor) -> Candidates:
    """These models, as a network that knows the first one's keypoints retrieves them."""
    arrays = database.candidates(category, model_ids)
    keypoints = torch.from_numpy(arrays.keypoints)
    return Candidates(
        model_ids=tuple(model_ids),
        category=category,
        distances=np.zeros(len(model_ids)),
        points=torch.from_numpy(arrays.points),
        basis=torch.from_numpy(arrays.point_basis),
        displacement=keypoints[0] - keypoints,
        target=view,
        confidence=torch.ones(12),
        partial=True,
        keypoints=keypoints[0],
        structures=arrays.structures,
        point_parts=arrays.point_parts,
        point_normals=arrays.point_normals,
    )


def test_a_model_seen_from_one_side_is_the_simplest_explanation() -> None:
    database, first, undeformed, count = resolve_database(None), 0, 0, 0
    for category in CATEGORIES:
        every = database.model_ids(category)
        for name in (every[5], every[45]):
            entry = database.entry(name)
            vertices, surface, view = _view(entry)
            others = [other for other in every[::20] if other != name][:4]
            candidates = _candidates(database, category, [name, *others], view)
            found = deform_candidates(candidates, _true_visibility(surface, view))
            best = rank_candidates(found)[0]
            count, first = count + 1, first + (best == 0)
            if best == 0 and found.explanations[0].step == "none":
                model = ModelPoints(vertices, entry.structure.vertex_parts, entry.vertex_basis.astype(np.float64))
                off = np.abs(found.explanations[0].deformation(model) - vertices).max()
                undeformed += off < 0.05  # 2.5 % of the longest side
    assert first >= count - 1
    # A table of which hardly any leg is seen may be explained better by parts that move a little.
    assert undeformed >= count - 2


@pytest.mark.slow
@pytest.mark.skipif(resolve_model(None).visibility is None, reason="the bundled model has no visibility network")
def test_some_models_of_the_database_scanned_from_one_side_return_themselves() -> None:
    """End to end, with retrieval and predicted visibility; 4 of 9 when this was written."""
    database, itself = resolve_database(None), 0
    for category in CATEGORIES:
        for name in database.model_ids(category)[5::40][:3]:
            entry = database.entry(name)
            view = entry.frame.from_unit(_view(entry)[2].double().numpy())
            fit = kpred.fit(view, category=category, up="y", pose="identity", clean=False)
            if fit.source.model_id == name and fit.source.step == "none":
                off = np.abs(fit.mesh.vertices - entry.mesh.vertices).max()
                itself += off < 0.05 * np.ptp(entry.mesh.vertices, axis=0).max()
    assert itself >= 3


def test_own_sizes_tell_twins_apart() -> None:
    """Of two models of one shape and two sizes, the one in the scan's own size comes first, undeformed."""
    database = resolve_database(None)
    name = database.model_ids("chair")[5]
    entry = database.entry(name)
    _, surface, view = _view(entry)
    twins = replace(_candidates(database, "chair", [name, name], view), scales=np.array([0.8, 1.0]) * entry.frame.scale)
    visibility = _true_visibility(surface, view)
    found = deform_candidates(twins, visibility, unit=entry.frame.scale)
    assert rank_candidates(found)[0] == 1
    assert found.explanations[1].step == "none"
    np.testing.assert_allclose(found.explanations[1].placement.size, 1.0, atol=1e-6)
    unknown = deform_candidates(twins, visibility, unit=None)
    assert unknown.explanations[0].score == unknown.explanations[1].score
