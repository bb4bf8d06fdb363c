"""Depth images of dense clouds: what is before, behind and beside a surface, and agreement with point visibility."""

import pytest
import torch

from kpred.ops.cloud_depth import CloudDepth, render_depth
from kpred.ops.occlusion import visible_to_camera

RESOLUTION = 24


@pytest.fixture
def wall(generator: torch.Generator) -> torch.Tensor:
    """A square in the plane z = 0, from -1 to 1."""
    points = 2 * torch.rand(1, 20000, 3, generator=generator) - 1
    points[..., 2] = 0.0
    return points


@pytest.fixture
def image(wall: torch.Tensor) -> CloudDepth:
    return render_depth(wall, torch.tensor([[0.0, 0.0, 4.0]]), RESOLUTION)


def test_places_before_a_wall_are_seen_and_those_behind_are_not(image: CloudDepth) -> None:
    places = torch.tensor([[[0.0, 0.0, 1.0], [0.5, -0.5, 0.0], [0.0, 0.0, -1.0], [0.6, 0.6, -0.8]]])
    assert image.sees(places).tolist() == [[True, True, False, False]]


def test_places_beside_a_wall_are_seen(image: CloudDepth) -> None:
    places = torch.tensor([[[1.8, 0.0, -0.5], [0.0, -9.0, 0.0], [0.0, 3.0, 1.0]]])
    assert image.sees(places).all()


def test_places_in_a_hole_are_seen(wall: torch.Tensor) -> None:
    frame = wall[:, (wall[0].abs().amax(1) > 0.5)]
    image = render_depth(frame, torch.tensor([[0.0, 0.0, 4.0]]), RESOLUTION)
    assert image.sees(torch.tensor([[[0.0, 0.0, -0.5], [0.8, 0.0, -0.5]]])).tolist() == [[True, False]]


def test_tolerance_is_the_depth_that_is_seen_behind_a_surface(image: CloudDepth) -> None:
    behind = torch.tensor([[[0.1, 0.1, -0.5], [0.1, 0.1, -1.2]]])
    assert image.sees(behind, tolerance=0.8).tolist() == [[True, False]]


def test_points_seen_are_those_of_point_visibility_but_for_gaps(generator: torch.Generator) -> None:
    clouds = torch.nn.functional.normalize(torch.randn(3, 30000, 3, generator=generator), dim=2)
    clouds[:, ::4] *= 0.5
    cameras = torch.tensor([[0.0, 1.0, 9.0], [7.0, 0.0, 3.0], [-5.0, 6.0, 1.0]])
    seen = render_depth(clouds, cameras, RESOLUTION).sees(clouds)
    expected = visible_to_camera(clouds, cameras, RESOLUTION)
    assert not (seen & ~expected).any()
    assert seen.sum() > 0.9 * expected.sum()


def test_gaps_between_points_do_not_show_what_is_behind(generator: torch.Generator) -> None:
    sparse = 2 * torch.rand(1, 900, 3, generator=generator) - 1
    sparse[..., 2] = 0.0
    image = render_depth(sparse, torch.tensor([[0.0, 0.0, 4.0]]), RESOLUTION)
    behind = 1.2 * torch.rand(1, 500, 3, generator=generator) - 0.6
    behind[..., 2] = -1.0
    assert not image.sees(behind).any()
