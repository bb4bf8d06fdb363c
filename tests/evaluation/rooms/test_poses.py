"""Results meet true poses by place, yaw up to symmetry, and size; each true one is met once."""

from dataclasses import replace

import numpy as np
import pytest

import kpred
from kpred.evaluation.rooms.poses import TruePose, aligned_rows, symmetry_order
from kpred.fitting.defaults import sample_scan
from kpred.fitting.object_fit import ObjectFit
from kpred.ops.rotations import yaw_rotation
from kpred.scenes.objects import SceneObject

TO_Z = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])


@pytest.fixture(scope="module")
def chair() -> ObjectFit:
    found = kpred.fit(sample_scan(), up="y")
    return ObjectFit(SceneObject("chair_1", "chair", found.points, np.arange(len(found.points)), "y"), found).rotated(
        TO_Z
    )


def true(chair: ObjectFit, row: int = 0) -> TruePose:
    assert chair.fit is not None
    vertices = chair.fit.frame.to_unit(np.asarray(chair.fit.mesh.vertices)) * chair.fit.frame.scale
    return TruePose(
        row, chair.fit.category, chair.cad_to_scan()[:3, 3], np.ptp(vertices, axis=0), chair.fit.frame.rotation[2], 1
    )


def test_a_result_meets_its_own_pose_and_none_that_is_off(chair: ObjectFit) -> None:
    pose = true(chair)
    turned = TO_Z @ yaw_rotation(np.radians(30)) @ TO_Z.T
    assert aligned_rows([pose], [chair]) == {0}
    assert aligned_rows([replace(pose, middle=pose.middle + [0.25, 0, 0])], [chair]) == set()
    assert aligned_rows([replace(pose, size=pose.size * 1.3)], [chair]) == set()
    assert aligned_rows([replace(pose, category="table")], [chair]) == set()
    assert aligned_rows([replace(pose, front=turned @ pose.front)], [chair]) == set()
    assert aligned_rows([replace(pose, front=turned @ pose.front, order=12)], [chair]) == {0}
    assert aligned_rows([replace(pose, front=-pose.front, order=2)], [chair]) == {0}


def test_a_true_object_is_met_once(chair: ObjectFit) -> None:
    poses = [true(chair), true(chair, 1)]
    assert aligned_rows(poses[:1], [chair, chair]) == {0}
    assert aligned_rows(poses, [chair, chair]) == {0, 1}


def test_symmetry_is_seen_on_the_surface(rng: np.random.Generator) -> None:
    def walls(wide: float, deep: float) -> np.ndarray:
        side = rng.integers(0, 4, 2000)
        along, height = rng.uniform(-1, 1, 2000), rng.uniform(-0.3, 0.3, 2000)
        x = np.where(side < 2, along, np.where(side == 2, 1.0, -1.0)) * wide
        z = np.where(side >= 2, along, np.where(side == 0, 1.0, -1.0)) * deep
        return np.column_stack([x, height, z])

    angle = rng.uniform(0, 2 * np.pi, 2000)
    round_ = np.column_stack([np.cos(angle), rng.uniform(-0.3, 0.3, 2000), np.sin(angle)])
    assert symmetry_order(round_) == 12
    assert symmetry_order(walls(1.0, 1.0)) == 4
    assert symmetry_order(walls(1.0, 0.5)) == 2
    one_sided = walls(1.0, 0.5)
    assert symmetry_order(one_sided[one_sided[:, 2] > -0.49]) == 1
