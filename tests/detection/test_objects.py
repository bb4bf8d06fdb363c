"""Detected objects as objects of a scene."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kpred.detection.detect import Detection, detect_objects
from kpred.detection.objects import detected_floor, detected_objects, level_scene, unexplained
from kpred.scenes.scene import Scene

TILT = Rotation.from_euler("x", 20, degrees=True).as_matrix()


@pytest.fixture(scope="module")
def found(furnished_room: tuple[np.ndarray, np.ndarray]) -> tuple[Scene, Detection]:
    scene = Scene(np.concatenate([furnished_room[0] @ TILT.T, np.full((1, 3), np.nan)]))
    return scene, detect_objects(scene.points)


def test_a_tilted_scene_is_levelled(found: tuple[Scene, Detection]) -> None:
    level = level_scene(*found)
    assert level.up == "z"
    floor = detected_floor(found[1])
    assert floor is not None
    assert np.quantile(level.points[:-1, 2], 0.1) == pytest.approx(floor.level, abs=0.03)


def test_every_point_belongs_to_one_thing(found: tuple[Scene, Detection]) -> None:
    scene, detection = found
    objects = detected_objects(level_scene(*found), detection)
    assert len({item.name for item in objects}) == len(objects) >= 3
    rows = np.concatenate([*(item.indices for item in objects), unexplained(scene, detection)])
    rows = np.concatenate([rows, np.flatnonzero(detection.structure)])
    assert sorted(rows.tolist()) == list(range(len(scene.points) - 1))
    assert all(item.score is not None and item.category in item.name for item in objects)
