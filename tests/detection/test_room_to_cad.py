"""A raw room becomes a CAD room: models stand where the furniture stands, in the scan's own frame."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from kpred.errors import ScanError
from kpred.fitting.defaults import sample_scan
from kpred.fitting.fit_room import fit_room
from kpred.fitting.fit_scene import SceneFit
from kpred.fitting.scene_nodes import POINTS_NODE
from kpred.scenes.scene import Scene, read_scene

Room = tuple[np.ndarray, np.ndarray]
TILT = Rotation.from_euler("xyz", [18, -10, 0], degrees=True).as_matrix()


@pytest.fixture(scope="module")
def fitted(furnished_room: Room) -> SceneFit:
    lamp = np.random.default_rng(0).normal([-0.5, 1.2, 1.5], 0.05, (500, 3))
    points = np.concatenate([furnished_room[0], lamp])
    return fit_room(Scene(points @ TILT.T, name="room"), top_k=3)


def test_models_stand_where_the_furniture_stands(fitted: SceneFit, furnished_room: Room) -> None:
    points, owner = furnished_room
    surest = {item.object.category: item for item in reversed(fitted.fitted)}
    assert {"chair", "table"} <= set(surest)
    for item in (surest["chair"], surest["table"]):
        assert item.fit is not None
        row = ("chair", "table", "cabinet").index(str(item.object.category))
        box = np.asarray(item.fit.mesh.vertices) @ TILT
        true = points[owner == row]
        middle = (box.min(axis=0) + box.max(axis=0) - true.min(axis=0) - true.max(axis=0)) / 2
        assert np.linalg.norm(middle[:2]) < 0.15, item.object.name
        assert abs(box[:, 2].min()) < 0.04, item.object.name


def test_the_glb_stands_upright_and_keeps_what_is_unexplained(fitted: SceneFit, tmp_path: Path) -> None:
    fitted.to_glb(tmp_path / "room.glb")
    loaded = trimesh.load_scene(tmp_path / "room.glb", process=False)
    assert {item.node for item in fitted.fitted} <= set(loaded.graph.nodes)
    matrix, name = loaded.graph[POINTS_NODE]
    cloud = np.asarray(loaded.geometry[name].vertices) @ matrix[:3, :3].T + matrix[:3, 3]
    lamp = np.linalg.norm(cloud - [-0.5, 1.5, -1.2], axis=1) < 0.3
    assert lamp.sum() > 400
    floor = min(
        float((loaded.geometry[geometry].vertices @ m[:3, :3].T + m[:3, 3])[:, 1].min())
        for node in loaded.graph.nodes_geometry
        if node != POINTS_NODE
        for m, geometry in [loaded.graph[node]]
    )
    assert abs(floor) < 0.04


def test_a_room_without_furniture_is_one_sentence(empty_room: np.ndarray) -> None:
    with pytest.raises(ScanError, match="floor and walls only"):
        fit_room(Scene(empty_room, name="empty"))
    with pytest.raises(ScanError, match="name the objects with --objects"):
        fit_room(Scene(np.random.default_rng(0).normal(size=(300, 3)), name="noise"))


def test_what_is_no_room_is_one_sentence() -> None:
    rng = np.random.default_rng(0)
    field = rng.uniform([-50, -50, 0], [50, 50, 0.3], (4000, 3))
    with pytest.raises(ScanError, match="m wide, too wide for a room"):
        fit_room(Scene(field, name="field"), up="z")
    with pytest.raises(ScanError, match="m wide, the scan of one object and no room; fit it with `kpred fit`"):
        fit_room(Scene(rng.normal(0.0, 0.2, (2000, 3)), name="thing"), up="z")


def test_one_object_is_no_room_even_if_parts_of_it_look_like_furniture() -> None:
    # Its seat alone would be found as a chair, in a direction that is not up.
    with pytest.raises(ScanError, match="fit it with `kpred fit`"):
        fit_room(read_scene(sample_scan()))
