"""Where unseen surface is expected: about the middle of the unit box, as far out as the scan reaches."""

import numpy as np
import pytest

from kpred.fitting.expected_surface import expected_surfaces


@pytest.fixture
def surfaces(rng):
    return rng.uniform([-0.9, -1.0, -0.3], [0.7, 0.8, 0.5], size=(3, 500, 3)).astype(np.float32)


def ends(surfaces):
    return surfaces.min(axis=1), surfaces.max(axis=1)


def test_they_lie_about_the_middle(surfaces, rng):
    found = expected_surfaces(surfaces, 0.1 * rng.normal(size=(300, 3)))
    low, high = ends(found)
    np.testing.assert_allclose(low, -high, atol=1e-6)
    np.testing.assert_allclose(high - low, np.subtract(*ends(surfaces)[::-1]), atol=1e-5)


def test_what_is_seen_on_one_side_has_its_like_on_the_other(surfaces, rng):
    scan = rng.uniform([0.0, 0.0, 0.0], [0.2, 0.2, 0.8], size=(2000, 3))
    low, high = ends(expected_surfaces(surfaces, scan))
    np.testing.assert_allclose(high[:, 2], np.quantile(scan[:, 2], 0.99), atol=1e-5)
    np.testing.assert_allclose(low, -high, atol=1e-6)


def test_a_stray_does_not_stretch_them(surfaces, rng):
    scan = 0.2 * rng.uniform(-1, 1, size=(1000, 3))
    strayed = np.concatenate([scan, [[5.0, 0.0, 0.0]]])
    np.testing.assert_allclose(expected_surfaces(surfaces, strayed), expected_surfaces(surfaces, scan), atol=1e-3)


def test_none_is_stretched_beyond_the_unit_box(surfaces):
    assert np.abs(expected_surfaces(surfaces, np.full((100, 3), 3.0))).max() == pytest.approx(1.0)


def test_a_flat_surface_stays_flat(surfaces):
    surfaces[:, :, 1] = 0.3
    found = expected_surfaces(surfaces, np.full((100, 3), 0.9))
    assert np.isfinite(found).all() and not found[:, :, 1].any()
