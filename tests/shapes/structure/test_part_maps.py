"""Maps of parts: affine fits, and the best box-like ones, against slow references."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from kpred.shapes.structure.part_maps import box_residuals, fit_part_maps, measure_shears, own_extents


def _parts(rng: np.random.Generator, count: int = 4) -> tuple[np.ndarray, np.ndarray]:
    """Random points of boxes of different sides and places, and the part of each."""
    parts = rng.integers(0, count, 60 * count)
    sides, places = rng.uniform(0.1, 0.6, (count, 3)), rng.uniform(-0.3, 0.3, (count, 3))
    return rng.uniform(-0.5, 0.5, (len(parts), 3)) * sides[parts] + places[parts], parts


def test_affine_maps_agree_with_least_squares_of_each_part(rng: np.random.Generator) -> None:
    source, parts = _parts(rng)
    result = source + rng.normal(0, 0.05, source.shape)
    maps = fit_part_maps(source, result, parts, 4)
    for part in range(4):
        own = np.column_stack([source[parts == part], np.ones((parts == part).sum())])
        expected = own @ np.linalg.lstsq(own, result[parts == part], rcond=None)[0]
        assert maps.carry(source, parts)[parts == part] == pytest.approx(expected, abs=1e-6)


def test_what_a_flat_part_leaves_open_follows_the_whole_mesh(rng: np.random.Generator) -> None:
    source, parts = _parts(rng, 2)
    source[parts == 1, 1] = 0.1
    scales = np.array([2.0, 0.5, 3.0])
    maps = fit_part_maps(source, source * scales, parts, 2)
    above = np.array([[0.0, 0.4, 0.0]])
    assert maps.carry(above, np.array([1])) == pytest.approx(above * scales, abs=1e-6)
    assert maps.linear == pytest.approx(np.stack([np.diag(scales)] * 2), abs=1e-6)
    rotation = Rotation.from_euler("z", 30, degrees=True).as_matrix()
    rotated = np.where(parts[:, None] == 1, source @ rotation.T, source)
    axes = np.tile(np.eye(3), (2, 1, 1))
    shears = measure_shears(fit_part_maps(source, rotated, parts, 2), axes, own_extents(source, parts, axes))
    assert shears == pytest.approx([0, 0], abs=1e-6)


def _box_residual(source: np.ndarray, result: np.ndarray, axes: np.ndarray, start: np.ndarray) -> float:
    """RMS distance to the best rotated copy that is scaled along the axes, by a general solver."""
    local, target = (source - source.mean(axis=0)) @ axes.T, result - result.mean(axis=0)

    def off(x: np.ndarray) -> np.ndarray:
        return (Rotation.from_rotvec(x[:3]).apply(local * x[3:]) - target).reshape(-1)

    found = least_squares(off, start, xtol=1e-14, ftol=1e-14, gtol=1e-14)
    return float(np.sqrt(2 * found.cost / len(source)))


def test_box_residuals_agree_with_a_general_solver(rng: np.random.Generator) -> None:
    source, parts = _parts(rng)
    axes = Rotation.random(4, random_state=1).as_matrix()
    linear = np.eye(3) + rng.normal(0, 0.25, (4, 3, 3))
    result = np.einsum("vij,vj->vi", linear[parts], source) + rng.normal(0, 0.01, source.shape)
    found = box_residuals(source, result, parts, axes, fit_part_maps(source, result, parts, 4))
    for part in range(4):
        own = parts == part
        starts = [np.append(Rotation.from_matrix(axes[part].T).as_rotvec(), [1, 1, 1])]
        starts += [np.append(axis, [1, 1, 1]) for axis in Rotation.random(8, random_state=2).as_rotvec()]
        expected = min(_box_residual(source[own], result[own], axes[part], start) for start in starts)
        assert found[part] == pytest.approx(expected, rel=1e-3)
        assert found[part] > 0.01


def test_a_part_is_a_box_along_its_own_axes_and_no_others(rng: np.random.Generator) -> None:
    local, parts = _parts(rng)
    axes = Rotation.random(4, random_state=3).as_matrix()
    source = np.einsum("vji,vj->vi", axes[parts], local)
    extents = own_extents(source, parts, axes)
    low = np.array([local[parts == part].min(axis=0) for part in range(4)])
    high = np.array([local[parts == part].max(axis=0) for part in range(4)])
    assert extents == pytest.approx(high - low)

    def measured(result: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        maps = fit_part_maps(source, result, parts, 4)
        return box_residuals(source, result, parts, axes, maps), measure_shears(maps, axes, extents)

    rotations = Rotation.random(4, random_state=4).as_matrix()
    for scales in ([1.6, 0.9, 2.0], [-1.0, 1.0, 1.0]):
        box, shear = measured(np.einsum("vij,vj->vi", rotations[parts], local * scales))
        assert box == pytest.approx(0, abs=1e-6) and shear == pytest.approx(0, abs=1e-6)
        noisy = np.einsum("vij,vj->vi", rotations[parts], local * scales) + rng.normal(0, 1e-3, local.shape)
        assert (measured(noisy)[0] < 2e-3).all()
    box, shear = measured(source * [1.6, 0.9, 2.0])
    assert (box > 0.003).all() and (shear > 1).all()
    leaning = local + np.column_stack([local[:, 1] * 0.3, local[:, 1] * 0, local[:, 1] * 0])
    box, shear = measured(np.einsum("vij,vj->vi", rotations[parts], leaning))
    assert (box > 0.001).all() and shear == pytest.approx(np.degrees(np.arctan(0.3)), abs=1e-6)
