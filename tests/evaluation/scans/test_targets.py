"""Virtual scans: by seed and id alone, one-sided, within their limits, and the truth leads back to the shape."""

import math

import numpy as np
import pytest
import torch
import trimesh
from scipy.spatial import cKDTree

from kpred.evaluation.metrics.symmetry import HALF_TURN, NONE
from kpred.evaluation.scans.targets import (
    DISTANCE,
    LONGEST_SIDE,
    NOISE,
    OFFSET,
    OUTLIER_BOX,
    OUTLIERS,
    ScanTarget,
    degraded,
    make_scan_target,
    random_camera,
    random_frame,
)
from kpred.shapes.mesh import Mesh
from kpred.synthetic.generator import generate

GENERATORS = [torch.Generator().manual_seed(seed) for seed in range(60)]


@pytest.fixture(scope="module")
def chair() -> Mesh:
    return generate("chair", 1, seed=5)[0]


@pytest.fixture(scope="module")
def target(chair: Mesh) -> ScanTarget:
    return make_scan_target(chair, "a", 0)


def test_a_scan_depends_on_seed_and_id_alone(chair: Mesh, target: ScanTarget) -> None:
    same = make_scan_target(chair, "a", 0)
    np.testing.assert_array_equal(same.scan, target.scan)
    np.testing.assert_array_equal(same.whole, target.whole)
    for other in (make_scan_target(chair, "b", 0), make_scan_target(chair, "a", 1)):
        assert not np.allclose(other.frame.center, target.frame.center)
        assert not np.allclose(other.visible[:10], target.visible[:10])


def test_the_truth_takes_the_scan_into_the_unit_box(target: ScanTarget) -> None:
    np.testing.assert_allclose(target.frame.to_unit(target.scan), target.known, atol=1e-9)
    assert (target.high - target.low).max() == pytest.approx(2, abs=1e-5)
    np.testing.assert_allclose(target.low + target.high, 0, atol=1e-5)
    assert len(target.scan) == len(target.whole) == 2048
    assert (target.whole >= target.low - 1e-5).all()
    assert (target.whole <= target.high + 1e-5).all()
    assert np.abs(target.known).max() <= 1.4


def test_what_is_seen_lies_on_the_surface(target: ScanTarget) -> None:
    assert cKDTree(target.whole).query(target.visible)[0].max() < 0.15


@pytest.mark.parametrize("name", ["one", "two", "three"])
def test_one_camera_sees_one_side(name: str) -> None:
    box = trimesh.creation.box((2, 1, 1))
    target = make_scan_target(Mesh(box.vertices.astype("f4"), box.faces.astype("i4")), name, 0)
    assert target.symmetry == HALF_TURN
    on_low, on_high = (
        np.isclose(target.visible, side, atol=1e-4).mean(axis=0) > 0.02 for side in (target.low, target.high)
    )
    assert not (on_low & on_high).any()
    assert not on_low[1]
    assert 2 <= on_low.sum() + on_high.sum() <= 3


def test_symmetry_is_that_of_the_whole_shape(target: ScanTarget) -> None:
    assert target.symmetry == NONE


def test_cameras_look_from_all_sides_and_from_above() -> None:
    cameras = torch.stack([random_camera(generator) for generator in GENERATORS]).numpy()
    away = np.linalg.norm(cameras, axis=1)
    assert away.min() >= 2 * DISTANCE[0] - 1e-5
    assert away.max() <= 2 * DISTANCE[1] + 1e-5
    elevation = np.degrees(np.arcsin(cameras[:, 1] / away))
    assert elevation.min() >= 0
    assert 40 < elevation.max() <= 45 + 1e-4
    quadrants = {(x > 0, z > 0) for x, _, z in cameras}
    assert len(quadrants) == 4


def test_frames_are_upright_and_within_their_limits() -> None:
    frames = [random_frame(generator) for generator in GENERATORS]
    sides = [2 * frame.scale for frame in frames]
    assert min(sides) >= LONGEST_SIDE[0]
    assert max(sides) <= LONGEST_SIDE[1]
    assert max(sides) > 4 * min(sides)
    assert max(np.abs(frame.center).max() for frame in frames) <= OFFSET
    turns = [math.atan2(frame.rotation[0, 2], frame.rotation[2, 2]) for frame in frames]
    assert max(turns) - min(turns) > 5
    for frame in frames:
        np.testing.assert_allclose(frame.rotation @ [0, 1, 0], [0, 1, 0])


def test_noise_is_along_the_ray_and_outliers_are_few_and_near() -> None:
    low, high = torch.tensor([-1.0, -0.5, -0.2]), torch.tensor([1.0, 0.5, 0.2])
    camera = torch.tensor([0.0, 0.0, 5.0])
    shares, deviations = [], []
    for generator in GENERATORS:
        seen = torch.rand(4000, 3, generator=generator) * 0.3
        moved = degraded(seen, camera, low, high, generator) - seen
        ray = torch.nn.functional.normalize(seen - camera, dim=1)
        across = (moved - (moved * ray).sum(1, keepdim=True) * ray).norm(dim=1)
        stray = across > 1e-5
        shares.append(float(stray.float().mean()))
        deviations.append(float((moved * ray).sum(1)[~stray].std()))
        assert ((seen + moved).abs()[stray] <= OUTLIER_BOX * high).all()
    assert max(shares) <= OUTLIERS
    assert max(shares) > 0.7 * OUTLIERS
    assert max(deviations) < 1.1 * NOISE
    assert max(deviations) > 0.8 * NOISE > 0.2 * NOISE > min(deviations)
