"""Cage refinement: closer to the scan, as stiff as furniture is, and the mesh that is delivered is what is measured."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import torch

import kpred
from kpred.fitting import RefineConfig, bundled_database_path, fit, surface_points
from kpred.fitting.cage_refinement import with_cages
from kpred.fitting.candidates import Candidates
from kpred.ops import chamfer_distance, sample_surface, squared_distances
from kpred.ops.lattice import lattice_asymmetry

NAMES = 3
CONFIG = RefineConfig()


@pytest.fixture(scope="module")
def database() -> kpred.Database:
    return kpred.Database.open(bundled_database_path(), read_only=True)


def _taller_seat(points: torch.Tensor) -> torch.Tensor:
    """Legs half as long, the back longer: no affine map."""
    x, y, z = points.unbind(-1)
    return torch.stack([0.9 * x, torch.where(y < 0, 0.6 * y, 1.2 * y), z + 0.05], dim=-1)


def _mesh_sample(
    database: kpred.Database, name: str, move: Callable[[np.ndarray], np.ndarray], seed: int = 5
) -> torch.Tensor:
    entry = database.entry(name)
    vertices = move(entry.frame.to_unit(entry.mesh.vertices.astype(np.float64)))
    return sample_surface(
        torch.from_numpy(np.asarray(vertices)).float(),
        torch.from_numpy(entry.mesh.faces).long(),
        2048,
        torch.Generator().manual_seed(seed),
    )[0]


def _candidates(database: kpred.Database, target: torch.Tensor, partial: bool = False) -> Candidates:
    """Three chairs as they are in the database; the first is what the target was made of."""
    names = database.model_ids("chair")[:NAMES]
    arrays = database.candidates("chair", names)
    return Candidates(
        model_ids=names,
        category="chair",
        distances=np.zeros(NAMES),
        points=torch.from_numpy(arrays.points),
        basis=torch.from_numpy(arrays.point_basis),
        displacement=torch.zeros(NAMES, arrays.keypoints.shape[1], 3),
        target=target,
        confidence=torch.ones(arrays.keypoints.shape[1]),
        partial=partial,
    )


@pytest.fixture(scope="module")
def target(database: kpred.Database) -> torch.Tensor:
    name = database.model_ids("chair")[0]
    return _mesh_sample(database, name, lambda v: _taller_seat(torch.from_numpy(v)).numpy())


def test_a_warp_that_is_not_affine_is_found(database: kpred.Database, target: torch.Tensor) -> None:
    before = _candidates(database, target).refined(CONFIG)
    caged, errors, _ = with_cages(before, before.errors(), database, CONFIG)
    again = _mesh_sample(database, before.model_ids[0], lambda v: _taller_seat(torch.from_numpy(v)).numpy(), seed=6)
    floor = chamfer_distance(target[None], again[None])[0]
    assert errors[0] < 1.25 * floor < 0.8 * before.errors()[0]
    assert torch.allclose(errors, caged.errors(), rtol=1e-4)
    assert sum(warp is not None for warp in caged.warps or ()) == CONFIG.cage_finalists
    for row, warp in enumerate(caged.warps or ()):
        if warp is None:
            assert torch.equal(caged.deformed()[row], before.deformed()[row])


def test_what_is_measured_is_the_mesh_that_is_delivered(database: kpred.Database, target: torch.Tensor) -> None:
    before = _candidates(database, target).refined(CONFIG)
    caged, errors, _ = with_cages(before, before.errors(), database, CONFIG)
    row = int(errors.argmin())
    entry = database.entry(caged.model_ids[row])
    mesh = _mesh_sample(database, entry.model_id, lambda v: caged.result_of(row, v, entry.vertex_basis), seed=7)
    again = _mesh_sample(database, entry.model_id, lambda v: _taller_seat(torch.from_numpy(v)).numpy(), seed=6)
    floor = float(chamfer_distance(target[None], again[None]))
    assert float(chamfer_distance(target[None], mesh[None])) == pytest.approx(float(errors[row]), abs=0.3 * floor)


def test_a_model_of_many_faces_moves_by_its_points(
    database: kpred.Database, target: torch.Tensor, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = _candidates(database, target).refined(CONFIG)
    _, usual, _ = with_cages(before, before.errors(), database, CONFIG)
    monkeypatch.setattr(surface_points, "MOST_FACES", 0)
    with kpred.Database.open(database.path, read_only=True) as fresh:
        _, errors, _ = with_cages(before, before.errors(), fresh, CONFIG)
    assert errors[0] == pytest.approx(float(usual[0]), rel=0.1)


def test_a_very_stiff_cage_leaves_lines_straight(database: kpred.Database, target: torch.Tensor) -> None:
    before = _candidates(database, target).refined(CONFIG)
    caged, _, _ = with_cages(before, before.errors(), database, replace(CONFIG, cage_smoothness=1e3))
    warp = next(warp for warp in caged.warps or () if warp is not None)
    ends = np.array([[-0.5, -1.0, -0.5], [0.4, 1.0, 0.5]])
    share = np.linspace(0, 1, 9)[:, None]
    line = warp((1 - share) * ends[0] + share * ends[1])
    assert np.allclose(line, (1 - share) * line[0] + share * line[-1], atol=1e-3)


def test_a_strong_mirror_keeps_the_warp_symmetric(database: kpred.Database, target: torch.Tensor) -> None:
    shoved = target + torch.tensor([0.1, 0.0, 0.0]) * (target[:, :1] > 0)
    form = lattice_asymmetry().float()
    cost = []
    for weight in (0.0, 1e3):
        before = _candidates(database, shoved).refined(CONFIG)
        caged, _, _ = with_cages(before, before.errors(), database, replace(CONFIG, cage_symmetry=weight))
        moved = next(warp for warp in caged.warps or () if warp is not None).displacement
        cost.append(float(torch.einsum("ia,aij,ja->", moved, form, moved)))
    assert cost[1] < 1e-4 * cost[0]


def test_of_a_partial_scan_the_unseen_stays_where_the_keypoints_put_it(
    database: kpred.Database, target: torch.Tensor
) -> None:
    seen = target[target[:, 1] > 0.1]
    before = _candidates(database, seen, partial=True)
    caged, errors, _ = with_cages(before, before.errors(), database, CONFIG)
    rows = [row for row, warp in enumerate(caged.warps or ()) if warp is not None]
    assert len(rows) == 1
    assert errors[rows[0]] < before.errors()[rows[0]]
    apart = squared_distances(before.points[rows], seen[None])[0].sqrt()
    moved = (caged.deformed()[rows[0]] - before.deformed()[rows[0]]).norm(dim=1)
    assert moved[apart > 0.4].mean() < 0.5 * moved[apart < 0.1].mean()


def test_a_cage_goes_with_its_candidate(database: kpred.Database, target: torch.Tensor) -> None:
    before = _candidates(database, target).refined(CONFIG)
    caged, _, _ = with_cages(before, before.errors(), database, CONFIG)
    turned = caged.take(torch.tensor([2, 0]))
    assert torch.equal(turned.deformed(), caged.deformed()[[2, 0]])
    assert (turned.warps or ())[1] is (caged.warps or ())[0]
    again = caged.refined(CONFIG)
    assert again.warps is None
    assert torch.allclose(again.deformed(), again.points + again.basis @ again.displacement, atol=1e-5)


@pytest.mark.parametrize(("cage", "caged"), [("always", True), ("full", True), ("never", False)])
def test_a_fit_uses_cages_as_told(database: kpred.Database, target: torch.Tensor, cage: str, caged: bool) -> None:
    config = replace(CONFIG, cage=cage)
    found = fit(target.double().numpy(), None, database, "chair", 3, "known", partial=False, refinement=config)
    plain = fit(
        target.double().numpy(),
        None,
        database,
        "chair",
        3,
        "known",
        partial=False,
        refinement=replace(config, cage="never"),
    )
    best, other = (min(one.final_error for one in result.candidates) for result in (found, plain))
    assert (best < 0.9 * other) == caged
    assert found.keypoints.shape == plain.keypoints.shape
    assert np.abs(found.keypoints).max() < 1.5
