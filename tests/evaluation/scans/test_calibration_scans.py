"""Virtual scans that look like real ones: by seed alone, within their limits, and the truth stays with them."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from kpred.evaluation.scans.calibration_scans import (
    BLOCK_RADIUS,
    CROP_MARGIN,
    MAX_CLUTTER,
    MAX_FLOOR,
    MAX_STRAYS,
    MIN_POINTS,
    NOISE,
    CalibrationScan,
    clutter,
    floor_strip,
    make_calibration_scan,
    uneven,
    without_blocks,
)
from kpred.evaluation.scans.targets import ScanTarget, make_scan_target
from kpred.shapes.mesh import Mesh
from kpred.synthetic.generator import generate


@pytest.fixture(scope="module")
def chair() -> Mesh:
    return generate("chair", 1, seed=5)[0]


@pytest.fixture(scope="module")
def target(chair: Mesh) -> ScanTarget:
    return make_scan_target(chair, "a", 0, views=0)


@pytest.fixture(scope="module")
def neighbour() -> np.ndarray:
    return make_scan_target(generate("table", 1, seed=5)[0], "n", 0, views=0).whole


@pytest.fixture(scope="module")
def scans(chair: Mesh, neighbour: np.ndarray) -> list[CalibrationScan]:
    return [make_calibration_scan(chair, f"chair {number}", neighbour, 7) for number in range(40)]


def _streams(count: int = 60) -> list[np.random.Generator]:
    return [np.random.default_rng(seed) for seed in range(count)]


def test_a_scan_depends_on_seed_and_id_alone(chair: Mesh, neighbour: np.ndarray, scans: list[CalibrationScan]) -> None:
    same = make_calibration_scan(chair, "chair 0", neighbour, 7)
    np.testing.assert_array_equal(same.target.scan, scans[0].target.scan)
    other = make_calibration_scan(chair, "chair 0", neighbour, 8)
    assert other.target.scan.shape != same.target.scan.shape or not np.allclose(other.target.scan, same.target.scan)


def test_all_kinds_occur_and_the_truth_leads_into_the_unit_box(scans: list[CalibrationScan]) -> None:
    assert {scan.kind for scan in scans} == {"whole", "views", "fragment"}
    for scan in scans:
        one = scan.target
        assert len(one.scan) >= 64
        assert np.isfinite(one.scan).all()
        np.testing.assert_allclose(one.frame.to_unit(one.scan), one.known, atol=1e-9)
        # Most of what is scanned is the object, up to noise.
        near = cKDTree(one.whole).query(one.known)[0] < 0.1 + 4 * NOISE
        assert near.mean() > 0.5


def test_blocks_are_balls_that_go_whole(target: ScanTarget) -> None:
    removed = []
    for rng in _streams():
        left = without_blocks(target.whole, rng)
        assert len(left) >= MIN_POINTS
        gone = cKDTree(left).query(target.whole)[0] > 0
        removed.append(int(gone.sum()))
        if gone.any():
            # Two balls at most, each with its points inside its radius.
            assert np.ptp(target.whole[gone], axis=0).max() <= 2 + 4 * BLOCK_RADIUS[1]
    assert removed.count(0) > 15
    assert max(removed) > 100


def test_density_falls_off_and_no_point_is_moved(target: ScanTarget) -> None:
    parts = [uneven(target.whole, rng) for rng in _streams()]
    rows = {tuple(point) for point in target.whole}
    assert all({tuple(point) for point in part} <= rows for part in parts)
    sizes = [len(part) for part in parts]
    assert max(sizes) == len(target.whole)
    assert MIN_POINTS <= min(sizes) < 0.6 * len(target.whole)


def test_clutter_is_what_a_crop_box_holds_of_a_neighbour(target: ScanTarget, neighbour: np.ndarray) -> None:
    pieces = [clutter(1000, neighbour, target, rng) for rng in _streams()]
    assert sum(not len(piece) for piece in pieces) > 15
    held = [piece for piece in pieces if len(piece)]
    assert len(held) > 5
    for piece in held:
        assert len(piece) <= MAX_CLUTTER * 1000
        assert (piece > target.low - CROP_MARGIN).all()
        assert (piece < target.high + CROP_MARGIN).all()


def test_the_floor_lies_below_the_object(target: ScanTarget) -> None:
    strips = [floor_strip(1000, target, rng) for rng in _streams()]
    assert sum(not len(strip) for strip in strips) > 15
    for strip in (strip for strip in strips if len(strip)):
        assert 30 <= len(strip) <= MAX_FLOOR * 1000
        assert np.abs(strip[:, 1] - target.low[1]).max() < 0.08
        assert np.ptp(strip[:, [0, 2]], axis=0).min() > 0


def test_strays_are_few(scans: list[CalibrationScan]) -> None:
    fractions = []
    for scan in scans:
        one = scan.target
        outside = (one.known < one.low - CROP_MARGIN - 6 * NOISE) | (one.known > one.high + CROP_MARGIN + 6 * NOISE)
        fractions.append(float(outside.any(axis=1).mean()))
    assert 0 < max(fractions) <= MAX_STRAYS
