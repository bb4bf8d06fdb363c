"""Voxel grids bound the number of points and keep track of every row."""

import numpy as np

from kpred.detection.voxels import voxel_grid, without_strays


def test_each_point_lies_in_its_own_cell() -> None:
    points = np.random.default_rng(0).uniform(-1, 1, (5000, 3))
    grid = voxel_grid(points, 0.1)
    assert grid.cell == 0.1
    assert grid.counts.sum() == len(points)
    assert np.abs(points - grid.points[grid.owner]).max() <= 0.1
    np.testing.assert_allclose(grid.points[grid.owner[0]], points[grid.owner == grid.owner[0]].mean(axis=0))


def test_large_rooms_are_put_on_a_coarser_grid() -> None:
    points = np.random.default_rng(0).uniform(0, 10, (60_000, 3)) * [1, 1, 0]
    grid = voxel_grid(points, 0.01, max_voxels=3000)
    assert 500 < len(grid) <= 3000
    assert grid.cell > 0.1


def test_rows_that_are_not_finite_belong_to_no_cell() -> None:
    points = np.random.default_rng(0).uniform(0, 1, (100, 3))
    points[7] = np.nan
    points[9, 1] = np.inf
    grid = voxel_grid(points, 0.05)
    assert np.flatnonzero(grid.owner < 0).tolist() == [7, 9]
    assert len(voxel_grid(np.full((3, 3), np.nan))) == 0


def test_voxels_that_stand_alone_go_and_surfaces_stay() -> None:
    rng = np.random.default_rng(0)
    wall = rng.uniform(0, 4, (20_000, 3)) * [1, 0, 1]
    strays = rng.uniform([-2, 0.5, -2], [6, 6, 6], (1000, 3))
    grid = without_strays(voxel_grid(np.concatenate([wall, strays, [[np.nan] * 3]])), 0.12)
    assert (grid.owner[:20_000] >= 0).all()
    assert (grid.owner[20_000:-1] < 0).mean() > 0.95
    assert grid.owner[-1] == -1
    assert np.abs(wall - grid.points[grid.owner[:20_000]]).max() < 0.021


def test_a_cloud_of_strays_alone_stays() -> None:
    grid = voxel_grid(np.random.default_rng(0).uniform(-5, 5, (500, 3)))
    assert without_strays(grid, 0.12) is grid
