"""Seen-through space: agreement with a slow ray by ray search, what no sensor saw, and the choice that it decides."""

import numpy as np
import pytest
import torch

import kpred
from kpred.errors import ConfigError
from kpred.refinement.free_space import MARGIN, free_space_errors, seen_through


@pytest.fixture
def wall(generator: torch.Generator) -> torch.Tensor:
    """A wall at z = -0.5, 2 wide and high, seen by a sensor in front of it."""
    wall = 2 * torch.rand(4000, 3, generator=generator) - 1
    wall[:, 2] = -0.5
    return wall


SENSOR = torch.tensor([[0.0, 0.0, 4.0]])


def _slow(points: torch.Tensor, scan: torch.Tensor, sensor: torch.Tensor) -> torch.Tensor:
    """For each point by itself: how much farther the nearest of the scan points in about its direction is."""
    found = []
    rays = scan - sensor
    distances = rays.norm(dim=1)
    for point in points:
        ray = point - sensor
        cosine = (rays @ ray) / (distances * ray.norm())
        near = cosine > np.cos(0.03)
        farther = (distances[near].min() - ray.norm()) if int(near.sum()) >= 2 else torch.tensor(0.0)
        found.append(farther if farther > MARGIN else torch.tensor(0.0))
    return torch.stack(found)


def test_agrees_with_a_slow_search(wall: torch.Tensor, generator: torch.Generator) -> None:
    points = 1.6 * torch.rand(200, 3, generator=generator) - 0.8
    fast, slow = seen_through(points[None], wall, SENSOR)[0], _slow(points, wall, SENSOR[0])
    assert ((fast > 0) == (slow > 0)).float().mean() > 0.95  # the cone's rim
    both = (fast > 0) & (slow > 0)
    assert int(both.sum()) > 50 and (fast[both] - slow[both]).abs().max() < 0.05


def test_space_before_the_wall_was_looked_through_and_space_behind_was_not(wall: torch.Tensor) -> None:
    before, behind, beside = (torch.tensor([[[x, 0.0, z]]]) for x, z in ((0.0, 0.3), (0.0, -1.0), (3.0, 0.0)))
    assert seen_through(before, wall, SENSOR)[0, 0] == pytest.approx(0.8, abs=0.05)
    assert seen_through(behind, wall, SENSOR) == 0
    assert seen_through(beside, wall, SENSOR) == 0, "nothing was seen in that direction"
    assert seen_through(wall[None, :500], wall, SENSOR).max() == 0


def test_every_sensor_counts_for_what_it_saw(wall: torch.Tensor) -> None:
    other_side = wall * torch.tensor([1.0, 1.0, -1.0])
    both = torch.cat([wall, other_side])
    sensors = torch.tensor([[0.0, 0.0, -4.0], [0.0, 0.0, 4.0]])
    between = torch.zeros(1, 1, 3)
    assert seen_through(between, both, sensors) == 0, "each side hides what is between"
    outside = torch.tensor([[[0.0, 0.0, 1.5]]])
    assert seen_through(outside, both, sensors) > 0.5


def test_results_that_fill_it_are_charged(wall: torch.Tensor) -> None:
    results = torch.stack([wall, wall + torch.tensor([0.0, 0.0, 0.5])])
    fine, charged = free_space_errors(results, wall, SENSOR).tolist()
    assert fine < 1e-4 < 0.02 < charged


def test_a_sensor_that_is_no_place_is_refused(wall: torch.Tensor) -> None:
    for broken in ([1.0, 2.0], [[np.nan, 0.0, 0.0]], []):
        with pytest.raises(ConfigError, match="sensor"):
            kpred.fit(wall.numpy().astype(float), sensor=np.array(broken))


def test_a_fit_takes_the_sensor_in_the_scans_own_frame(wall: torch.Tensor) -> None:
    from kpred.ops import depth_scan
    from kpred.synthetic.generator import generate

    mesh = generate("chair", 3, seed=78)[2]
    vertices, faces = torch.tensor(mesh.vertices).float(), torch.tensor(mesh.faces).long()
    camera = torch.tensor([1.2, 1.4, 2.2])
    scan = depth_scan(vertices, faces, camera, 2000, generator=torch.Generator().manual_seed(0)).double().numpy()
    here = kpred.fit(scan, category="chair", up="y", sensor=camera.numpy())
    moved = kpred.fit(1000 * scan + 500, category="chair", up="y", sensor=1000 * camera.numpy() + 500)
    assert moved.source.model_id == here.source.model_id
    np.testing.assert_allclose((moved.mesh.vertices - 500) / 1000, here.mesh.vertices, atol=2e-3 * here.frame.scale)
