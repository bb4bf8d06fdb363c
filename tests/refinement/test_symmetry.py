"""The scan's mirror image: where it is, how much it counts, and what it does for the unseen half."""

import pytest
import torch

from kpred.fitting import RefineConfig
from kpred.ops import affine_influence, enclosing_cage, icosphere, mean_value_coordinates, squared_distances
from kpred.refinement.free_space import depth_pictures
from kpred.refinement.keypoints import Hints, refine_candidates
from kpred.refinement.symmetry import Reflection, asymmetry, reflect

MIRROR = torch.tensor([-1.0, 1.0, 1.0])


@pytest.fixture
def keypoints(generator: torch.Generator) -> torch.Tensor:
    """Twelve that are symmetric about x = 0."""
    half = torch.rand(6, 3, generator=generator)
    return torch.cat([half, half * MIRROR])


def test_symmetric_keypoints_have_no_asymmetry_and_moving_one_side_makes_some(keypoints: torch.Tensor) -> None:
    assert asymmetry(keypoints) == pytest.approx(0.0, abs=1e-6)
    assert asymmetry(keypoints + torch.tensor([0.3, 0.0, 0.0])) > 0.1


def test_mirrored_points_count_in_full_if_the_keypoints_are_symmetric(
    keypoints: torch.Tensor, generator: torch.Generator
) -> None:
    scan = torch.rand(100, 3, generator=generator)
    found = reflect(scan, keypoints)
    assert torch.allclose(found.points * MIRROR, scan)
    assert torch.allclose(found.weight, torch.ones(100), atol=1e-4)
    doubtful = reflect(scan, keypoints + torch.tensor([1.0, 0.0, 0.0]))
    assert doubtful.weight.max() < 0.5


def test_a_mirrored_point_where_the_sensor_looked_through_does_not_count(
    keypoints: torch.Tensor, generator: torch.Generator
) -> None:
    """A board on the right; on the left the sensor saw the wall behind."""
    spread = torch.rand(4000, 3, generator=generator)
    board = torch.tensor([0.3, -0.5, 0.0]) + spread[:2000] * torch.tensor([0.5, 1.0, 0.0])
    wall = torch.tensor([-1.0, -1.0, -1.0]) + spread[2000:] * torch.tensor([1.2, 2.0, 0.0])
    scan = torch.cat([board, wall])[torch.randperm(4000, generator=generator)]
    pictures = depth_pictures(scan, torch.tensor([[0.0, 0.0, 4.0]]))
    found = reflect(scan, keypoints, pictures)
    of_board = found.points[:, 2] == 0.0
    assert (found.weight[of_board] == 0).float().mean() > 0.9
    assert (found.weight[~of_board] > 0).float().mean() > 0.9


def test_the_unseen_half_follows_the_seen_one(generator: torch.Generator) -> None:
    """A box grows wider; only its right half is seen, and the network did not notice."""
    points = torch.rand(1, 1500, 3, generator=generator) * 2 - 1
    axis = torch.randint(0, 3, (1, 1500, 1), generator=generator)
    points = points.scatter(2, axis, torch.gather(points, 2, axis).sign()) * torch.tensor([0.6, 0.8, 0.5])
    cage, keypoints = enclosing_cage(points), points[:, :12]
    basis = mean_value_coordinates(points, cage, icosphere()[1]) @ affine_influence(keypoints, cage).transpose(1, 2)
    whole = points * torch.tensor([1.25, 1.0, 1.0])
    scan = whole[0][whole[0, :, 0] > 0]
    mirror_image = Reflection(scan * MIRROR, torch.ones(len(scan)))
    start, errors = torch.zeros(1, 12, 3), []
    for hints in (Hints(), Hints(reflection=mirror_image)):
        found = refine_candidates(
            points, basis, start, scan, torch.ones(12), RefineConfig(reflection=2.0), partial=True, hints=hints
        )
        errors.append(float(squared_distances(whole, points + basis @ found.displacement).mean()))
    assert errors[1] < 0.6 * errors[0]


def test_full_scans_and_a_weight_of_zero_know_no_reflection(generator: torch.Generator) -> None:
    points = torch.rand(1, 200, 3, generator=generator)
    basis = torch.rand(1, 200, 12, generator=generator)
    start, target = torch.zeros(1, 12, 3), points[0] + 0.05
    hints = Hints(reflection=Reflection(target * MIRROR, torch.ones(200)))
    for partial, weight in ((False, 1.0), (True, 0.0)):
        config = RefineConfig(reflection=weight)
        with_it, without = (
            refine_candidates(points, basis, start, target, torch.ones(12), config, partial, hints=given)
            for given in (hints, None)
        )
        assert torch.equal(with_it.displacement, without.displacement)
