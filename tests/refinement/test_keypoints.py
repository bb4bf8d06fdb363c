"""Keypoint refinement: linear least squares between nearest-neighbour updates."""

import numpy as np
import pytest
import torch

from kpred.fitting import RefineConfig, refine_keypoints
from kpred.fitting.candidates import Candidates
from kpred.ops import (
    affine_influence,
    chamfer_distance,
    enclosing_cage,
    icosphere,
    mean_value_coordinates,
    squared_distances,
)
from kpred.ops.occlusion import slice_by_plane
from kpred.refinement.free_space import depth_pictures
from kpred.refinement.keypoints import Hints, refine_candidates


@pytest.fixture
def source(generator: torch.Generator) -> tuple[torch.Tensor, torch.Tensor]:
    """Three sources on a box surface and their deformation bases."""
    points = torch.rand(3, 1500, 3, generator=generator) * 2 - 1
    axis = torch.randint(0, 3, (3, 1500, 1), generator=generator)
    points = points.scatter(2, axis, torch.gather(points, 2, axis).sign()) * torch.tensor([1.0, 0.6, 0.8])
    keypoints = points[:, :12]
    cage = enclosing_cage(points)
    weights = mean_value_coordinates(points, cage, icosphere()[1])
    return points, weights @ affine_influence(keypoints, cage).transpose(1, 2)


def test_it_finds_the_displacement_that_made_the_target(source: tuple, generator: torch.Generator) -> None:
    points, basis = source
    wanted = 0.12 * torch.randn(3, 12, 3, generator=generator)
    target = points + basis @ wanted
    ones = torch.ones(12)
    config = RefineConfig(iterations=30, points=1500, prior=1e-4, robust=0.0)
    found = refine_keypoints(points, basis, torch.zeros(3, 12, 3), target, ones, config, partial=False)
    before, after = chamfer_distance(target, points), chamfer_distance(target, points + basis @ found)
    assert (after < 0.15 * before).all()


def test_the_right_displacement_is_a_fixed_point(source: tuple, generator: torch.Generator) -> None:
    points, basis = source
    wanted = 0.1 * torch.randn(3, 12, 3, generator=generator)
    target = points + basis @ wanted
    config = RefineConfig(points=1500, robust=0.0)
    found = refine_keypoints(points, basis, wanted, target, torch.ones(12), config, partial=False)
    assert torch.allclose(found, wanted, atol=2e-3)


def test_candidates_do_not_touch_each_other(source: tuple) -> None:
    points, basis = source
    target = points[0] * torch.tensor([1.1, 0.9, 1.0])
    arguments = (torch.ones(12), RefineConfig(), False)
    start = torch.zeros(3, 12, 3)
    together = refine_keypoints(points, basis, start, target, *arguments)
    for row in range(3):
        one = slice(row, row + 1)
        alone = refine_keypoints(points[one], basis[one], start[one], target, *arguments)
        assert torch.allclose(together[one], alone, atol=1e-4)


def test_a_strong_prior_holds_the_network_keypoints(source: tuple) -> None:
    points, basis = source
    target = points[0] * 1.2
    held = refine_keypoints(
        points, basis, torch.zeros(3, 12, 3), target, torch.ones(12), RefineConfig(prior=1e6), partial=False
    )
    assert held.abs().max() < 1e-3


def test_outliers_move_robust_keypoints_less(source: tuple, generator: torch.Generator) -> None:
    points, basis = source
    stray = 1.5 + torch.rand(100, 3, generator=generator)
    target = torch.cat([points[0], stray])
    clean = points[0]
    errors = {}
    for robust in (0.0, 4.0):
        config = RefineConfig(robust=robust, points=1600)
        found = refine_keypoints(points[:1], basis[:1], torch.zeros(1, 12, 3), target, torch.ones(12), config, False)
        errors[robust] = float(chamfer_distance(clean[None], points[:1] + basis[:1] @ found))
    assert errors[4.0] < 0.2 * errors[0.0]


def test_partial_scans_leave_the_unseen_part_alone(source: tuple) -> None:
    points, basis = source
    full = points[0]
    visible = slice_by_plane(full[None], torch.tensor([0.5]), torch.tensor([[1.0, 0.0, 0.0]]))[0]
    confidence = (points[0, :12, 0] < 0).float()
    start = torch.zeros(1, 12, 3)
    one_sided, two_sided = (
        refine_keypoints(points[:1], basis[:1], start, full[visible], confidence, RefineConfig(), partial)
        for partial in (True, False)
    )
    unseen = confidence == 0
    assert one_sided[0, unseen].norm(dim=1).mean() < 0.3 * two_sided[0, unseen].norm(dim=1).mean()


def _half_seen(source: tuple, generator: torch.Generator) -> tuple[torch.Tensor, ...]:
    """Sources, bases, a target, its half at x < 0, and a start that is right about the unseen keypoints alone."""
    points, basis = source
    wanted = 0.15 * torch.randn(3, 12, 3, generator=generator)
    whole = points + basis @ wanted
    seen = slice_by_plane(whole, torch.full((3,), 0.5), torch.tensor([[1.0, 0.0, 0.0]]).expand(3, -1))
    visible = torch.stack([cloud[mask] for cloud, mask in zip(whole, seen, strict=True)])
    unseen_keypoints = points[:, :12, :1] > 0
    return points, basis, whole, visible, torch.where(unseen_keypoints, wanted, torch.zeros_like(wanted))


def test_holding_the_unseen_surface_lowers_the_error_of_the_whole(source: tuple, generator: torch.Generator) -> None:
    points, basis, whole, visible, start = _half_seen(source, generator)
    errors = {}
    for unseen in (0.0, 0.5):
        config = RefineConfig(unseen=unseen)
        found = refine_keypoints(points, basis, start, visible, torch.ones(12), config, partial=True)
        errors[unseen] = float(squared_distances(whole, points + basis @ found).mean())
    before = float(squared_distances(whole, points + basis @ start).mean())
    assert errors[0.5] < 0.9 * errors[0.0]
    assert errors[0.5] < 0.7 * before


def test_a_partial_scan_that_shows_all_is_refined_as_freely(source: tuple, generator: torch.Generator) -> None:
    points, basis = source
    target = points + basis @ (0.05 * torch.randn(3, 12, 3, generator=generator))
    start, ones = torch.zeros(3, 12, 3), torch.ones(12)
    before = float(squared_distances(target, points).mean())
    errors = [
        float(squared_distances(target, points + basis @ found).mean())
        for found in (
            refine_keypoints(points, basis, start, target, ones, RefineConfig(unseen=unseen), partial=True)
            for unseen in (0.0, 0.5)
        )
    ]
    assert errors[1] - errors[0] < 0.02 * before


def test_surface_leaves_space_that_the_sensor_looked_through(generator: torch.Generator) -> None:
    """A wall that the scan shows, and a board before it that only the network expects; one keypoint moves each."""
    spread = 2 * torch.rand(2000, 3, generator=generator) - 1
    is_board = torch.arange(2000) % 4 == 0
    points = torch.where(is_board[:, None], 0.5 * spread, spread)
    points[:, 2] = torch.where(is_board, -0.2, -0.5)
    basis = torch.stack([~is_board, is_board], dim=1).float()
    scan = points[~is_board]
    start = torch.zeros(1, 2, 3)
    unaware, aware = (
        refine_candidates(
            points[None], basis[None], start, scan, torch.ones(2), RefineConfig(), partial=True, hints=Hints(pictures)
        ).displacement[0]
        for pictures in ((), tuple(depth_pictures(scan, torch.tensor([[0.0, 0.0, 4.0]]))))
    )
    assert unaware[1].abs().max() < 0.02
    assert aware[1, 2] < -0.05, "toward the wall that was seen behind it"
    assert aware[0].abs().max() < 0.02, "the wall stays"


def test_candidates_far_behind_stop_early(source: tuple) -> None:
    points, basis = source
    found = Candidates(
        model_ids=("a", "b", "c"),
        category="chair",
        distances=np.zeros(3),
        points=points,
        basis=basis,
        displacement=torch.zeros(3, 12, 3),
        target=points[0] * torch.tensor([1.2, 0.9, 1.05]),
        confidence=torch.ones(12),
        partial=False,
    )
    config = RefineConfig(prior=1.0, finalists=2)
    refined = found.refined(config)
    assert refined.stopped is not None and refined.stopped.sum() == 1
    assert torch.equal(refined.errors().isinf(), refined.stopped)
    assert (refined.errors() < found.errors())[~refined.stopped].all()
    for row in range(3):
        alone = refined.take(torch.tensor([row]))
        assert alone.model_ids == (found.model_ids[row],)
        assert torch.allclose(alone.deformed()[0], refined.deformed()[row], atol=1e-5)
    ends = (~refined.stopped).nonzero()[:, 0]
    again = refined.refined(config, ends)
    assert (again.errors() <= 1.05 * refined.errors()[ends]).all()
    late = refined.refined(config, refined.stopped.nonzero()[:, 0])
    assert late.errors().isfinite().all()
