"""Detected objects as the objects of a scene, and what of the scan belongs to none."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np

from kpred.detection.detect import Detection
from kpred.ops.typing import Int
from kpred.scenes.floor import SceneFloor
from kpred.scenes.objects import SceneObject
from kpred.scenes.scene import Scene


def level_scene(scene: Scene, detection: Detection) -> Scene:
    """Return the scene rotated so that its nearest axis points up; the scene itself if it is level."""
    gravity = detection.gravity
    points = scene.points @ gravity.rotation.T if gravity.is_tilted else scene.points
    return replace(scene, points=points, up=gravity.axis)


def detected_objects(scene: Scene, detection: Detection) -> list[SceneObject]:
    """List the detected objects of a level scene, the likeliest first, named `chair_1`, `chair_2`, `table_1`, ..."""
    seen: Counter[str] = Counter()
    objects = []
    for item in detection.objects:
        seen[item.category] += 1
        name = f"{item.category}_{seen[item.category]}"
        points = scene.points[item.rows]
        objects.append(SceneObject(name, item.category, points, item.rows, scene.up, score=item.score))
    return objects


def detected_floor(detection: Detection) -> SceneFloor | None:
    """Return the detected floor as that of the level scene; None without one."""
    if detection.floor is None:
        return None
    level, gravity = detection.floor, detection.gravity
    return SceneFloor(gravity.axis, level, np.zeros(2), "points", gravity.metres)


def unexplained(scene: Scene, detection: Detection) -> Int[np.ndarray, " points"]:
    """List rows of the scene's points that belong neither to an object nor to floor, walls and ceiling."""
    rest = np.isfinite(scene.points).all(axis=1) & ~detection.structure
    for item in detection.objects:
        rest[item.rows] = False
    return np.flatnonzero(rest)
