"""Occlusion: exact shares, half spaces, and a depth camera that sees no hidden side."""

import numpy as np
import pytest
import torch

from kpred.ops import nearest_neighbours, sample_surface
from kpred.ops.occlusion import depth_scan, random_directions, resample_visible, slice_by_plane, visible_to_camera

BOX = (
    torch.tensor([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)]),
    torch.tensor(
        [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]]
        + [[2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
    ),
)


def test_random_directions_are_unit_and_isotropic(generator: torch.Generator) -> None:
    found = random_directions(20_000, generator)
    torch.testing.assert_close(found.norm(dim=1), torch.ones(20_000))
    assert found.mean(0).abs().max() < 0.02
    torch.testing.assert_close(found.T @ found / 20_000, torch.eye(3) / 3, rtol=0, atol=0.02)


@pytest.mark.parametrize("ratio", [0.0, 0.25, 0.333, 0.9, 0.999])
def test_slicing_hides_the_exact_share_beyond_a_plane(generator: torch.Generator, ratio: float) -> None:
    points = torch.randn(4, 257, 3, generator=generator)
    points[:, 100:140] = points[:, :1]  # coinciding points: the share is exact all the same
    normal = random_directions(4, generator)
    visible = slice_by_plane(points, torch.full((4,), ratio), normal)
    assert ((~visible).sum(1) == round(ratio * 257)).all()
    height = (points * normal[:, None]).sum(-1)
    for seen, h in zip(visible, height, strict=True):
        if seen.all() or not seen.any():
            continue
        assert h[seen].max() <= h[~seen].min()


def test_each_shape_has_its_own_plane_and_share(generator: torch.Generator) -> None:
    points = torch.randn(2, 100, 3, generator=generator)
    normal = torch.tensor([[0.0, 1, 0], [0, -1, 0]])
    visible = slice_by_plane(points, torch.tensor([0.5, 0.1]), normal)
    assert visible.sum(1).tolist() == [50, 90]
    assert points[0, visible[0], 1].max() <= points[0, ~visible[0], 1].min()
    assert points[1, visible[1], 1].min() >= points[1, ~visible[1], 1].max()


def test_resampling_takes_visible_points_and_repeats_only_when_it_must(generator: torch.Generator) -> None:
    visible = torch.rand(3, 200, generator=generator) < torch.tensor([[0.9], [0.5], [0.1]])
    for count in (10, 64, 500):
        index = resample_visible(torch.zeros(3, 200, 3), visible, count, generator)
        assert torch.gather(visible, 1, index).all()
        for rows, seen in zip(index, visible, strict=True):
            times = np.bincount(rows.numpy(), minlength=200)[seen.numpy()]
            available = int(seen.sum())
            assert set(times) <= {count // available, -(-count // available)}
    draws = torch.stack([resample_visible(torch.zeros(3, 200, 3), visible, 10, generator) for _ in range(2)])
    assert not torch.equal(draws[0], draws[1])


def _share_on_sides(seen: torch.Tensor) -> dict[str, float]:
    near = (seen.abs() > 1 - 1e-4).float() * seen.sign()
    return {
        f"{'+' if s > 0 else '-'}{axis}": float((near[:, i] == s).float().mean())
        for i, axis in enumerate("xyz")
        for s in (1, -1)
    }


@pytest.mark.parametrize("resolution", [64, 160])
def test_a_box_seen_from_the_front_shows_no_other_side(generator: torch.Generator, resolution: int) -> None:
    seen = depth_scan(*BOX, torch.tensor([0.0, 0.0, 5.0]), 100_000, resolution, generator=generator)
    sides = _share_on_sides(seen)
    assert sides["+z"] > 1 - 4 / resolution
    # The far side is hidden all over; of the other sides no more than the rim, one pixel deep.
    assert sides["-z"] == 0
    rim = 2 * 2.0 / resolution
    assert seen[:, 2].min() > 1 - rim
    # The visible side is covered everywhere, not here and there.
    cells = ((seen[:, :2] + 1) / 2 * 10).long().clamp(0, 9)
    assert len(cells.unique(dim=0)) == 100


def test_a_box_seen_from_a_corner_shows_three_sides(generator: torch.Generator) -> None:
    seen = depth_scan(*BOX, torch.tensor([4.0, 4.0, 4.0]), 100_000, generator=generator)
    sides = _share_on_sides(seen)
    assert min(sides["+x"], sides["+y"], sides["+z"]) > 0.3
    hidden = (seen < -0.97).any(1) & ~(seen > 0.97).any(1)
    assert hidden.float().mean() < 1e-3


@pytest.mark.parametrize("tilt", [0.0, 0.7])
def test_a_wall_hides_what_stands_behind_it(generator: torch.Generator, tilt: float) -> None:
    wall = torch.tensor([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    wall[:, 2] = tilt * wall[:, 0]
    behind = 0.5 * wall + torch.tensor([0.0, 0.0, -0.2])
    vertices = torch.cat([wall, behind])
    faces = torch.tensor([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
    seen = depth_scan(vertices, faces, torch.tensor([0.0, 0.0, 4.0]), 100_000, generator=generator)
    on_wall = (seen[:, 2] - tilt * seen[:, 0]).abs() < 1e-5
    assert on_wall.all()
    # A slanted wall is seen on all of it.
    assert len(((seen[:, :2] + 1) / 2 * 10).long().clamp(0, 9).unique(dim=0)) == 100
    # From the other side the small wall is seen too.
    back = depth_scan(vertices, faces, torch.tensor([0.0, 0.0, -4.0]), 100_000, generator=generator)
    assert ((back[:, 2] - tilt * back[:, 0]).abs() > 1e-3).float().mean() > 0.1


def test_clean_points_lie_on_the_mesh_and_number_at_most_count(generator: torch.Generator) -> None:
    seen = depth_scan(*BOX, torch.tensor([2.0, 3.0, 4.0]), 500, generator=generator)
    assert seen.shape == (500, 3)
    torch.testing.assert_close(seen.abs().amax(1), torch.ones(500))


def test_noise_runs_along_the_viewing_ray(generator: torch.Generator) -> None:
    camera = torch.tensor([0.0, 0.0, 5.0])
    noisy = depth_scan(*BOX, camera, 20_000, noise=0.01, generator=generator)
    ray = torch.nn.functional.normalize(noisy - camera, dim=1)
    along = (noisy[:, 2] - 1) / ray[:, 2]
    middle = along[(noisy[:, :2].abs() < 0.9).all(1)]
    assert middle.std().item() == pytest.approx(0.01, rel=0.05)
    assert abs(middle.mean().item()) < 5e-4


@pytest.mark.parametrize("dropout", [0.0, 0.3, 0.8])
def test_dropout_loses_its_share_of_pixels(dropout: float) -> None:
    camera = torch.tensor([0.0, 0.0, 5.0])
    full, left = (
        len(depth_scan(*BOX, camera, 1_000_000, dropout=d, generator=torch.Generator().manual_seed(1)))
        for d in (0.0, dropout)
    )
    assert left / full == pytest.approx(1 - dropout, abs=0.02)


def test_outliers_replace_their_share(generator: torch.Generator) -> None:
    seen = depth_scan(*BOX, torch.tensor([0.0, 0.0, 5.0]), 10_000, outliers=0.1, generator=generator)
    assert len(seen) == 10_000
    off = (seen[:, 2] - 1).abs() > 0.05
    assert off.float().mean().item() == pytest.approx(0.1, abs=0.01)
    assert seen.abs().max() <= 1.2
    assert seen.abs().max() > 1.1


def test_the_same_state_gives_the_same_scan() -> None:
    draws = [
        depth_scan(*BOX, torch.tensor([1.0, 2.0, 5.0]), 300, 64, 0.01, 0.1, 0.05, torch.Generator().manual_seed(s))
        for s in (1, 1, 2)
    ]
    assert torch.equal(draws[0], draws[1])
    assert not torch.equal(draws[0], draws[2])


def test_units_and_place_of_the_mesh_do_not_matter() -> None:
    camera = torch.tensor([2.0, 1.0, 5.0], dtype=torch.float64)
    vertices = BOX[0].double()
    near = depth_scan(vertices, BOX[1], camera, 300, 64, generator=torch.Generator().manual_seed(1))
    shift = torch.tensor([100.0, -20, 3], dtype=torch.float64)
    far = depth_scan(
        1000 * vertices + shift, BOX[1], 1000 * camera + shift, 300, 64, generator=torch.Generator().manual_seed(1)
    )
    torch.testing.assert_close((far - shift) / 1000, near, rtol=0, atol=1e-9)


def test_points_that_hide_each_other_show_what_the_exact_scan_shows(generator: torch.Generator) -> None:
    parts = [
        BOX[0] * torch.tensor([0.9, 0.05, 0.9]),
        BOX[0] * torch.tensor([0.1, 0.4, 0.1]) - torch.tensor([0, 0.45, 0]),
    ]
    vertices, faces = torch.cat(parts), torch.cat([BOX[1], BOX[1] + 8])
    cloud = sample_surface(vertices, faces, 16384, generator)[0]
    cameras = torch.tensor([[2.0, 1.5, 3.0], [0.5, -2.5, 2.0], [-3.0, 1.6, 0.2]])
    visible = visible_to_camera(cloud.expand(3, -1, -1), cameras, 48)
    for seen, camera in zip(visible, cameras, strict=True):
        exact = depth_scan(vertices, faces, camera, 6000, resolution=160, generator=generator)
        extra = nearest_neighbours(cloud[seen][None], exact[None])[0].sqrt()
        missed = nearest_neighbours(exact[None], cloud[seen][None])[0].sqrt()
        assert (extra > 0.08).float().mean() < 0.01 and (missed > 0.08).float().mean() < 0.01


def test_what_a_camera_sees_does_not_depend_on_place_or_unit(generator: torch.Generator) -> None:
    cloud = sample_surface(*BOX, 8192, generator)[0][None]
    camera = torch.tensor([[2.0, 1.0, 2.5]])
    seen = visible_to_camera(cloud, camera, 32)
    moved = visible_to_camera(cloud * 40 + 7, camera * 40 + 7, 32)
    assert (seen != moved).float().mean() < 0.002
    assert 0.3 < seen.float().mean() < 0.6
