"""SDF: one model a file, in its place; what it says stands in a simulation."""

from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kpred.exports.formats import save_export
from kpred.exports.furniture import Export


def pose_of(element: Any) -> tuple[np.ndarray, np.ndarray]:
    values = [float(word) for word in (element.findtext("pose") or "0 0 0 0 0 0").split()]
    quaternion = Rotation.from_euler("xyz", values[3:]).as_quat()[[3, 0, 1, 2]]
    return np.array(values[:3]), quaternion


def add_model(mujoco: Any, world: Any, model: Any) -> None:
    """Add an SDF model with box colliders to a MuJoCo world, as the SDF specification reads it."""
    place, quaternion = pose_of(model)
    body = world.add_body(name=model.get("name"), pos=place, quat=quaternion)
    body.add_freejoint()
    inertial = model.find("link/inertial")
    body.explicitinertial = True
    body.mass = float(inertial.findtext("mass"))
    body.ipos = pose_of(inertial)[0]
    body.fullinertia = [
        float(inertial.findtext(f"inertia/{key}")) for key in ["ixx", "iyy", "izz", "ixy", "ixz", "iyz"]
    ]
    for collision in model.iterfind("link/collision"):
        center, turned = pose_of(collision)
        size = [float(word) / 2 for word in collision.findtext("geometry/box/size").split()]
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, pos=center, quat=turned, size=size)


def test_a_chair_stands_for_half_a_minute(chair: Export, tmp_path: Path) -> None:
    mujoco = pytest.importorskip("mujoco")
    files = save_export(chair, tmp_path / "chair.sdf")
    root = ElementTree.parse(files[0]).getroot()
    assert root.tag == "sdf" and root.get("version") == "1.8"
    (model,) = root.findall("model")
    spec = mujoco.MjSpec()
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 0.1], pos=[0, 0, 0.5])
    add_model(mujoco, spec.worldbody, model)
    world = spec.compile()
    data = mujoco.MjData(world)
    for _ in range(int(30 / world.opt.timestep)):
        mujoco.mj_step(world, data)
    np.testing.assert_allclose(data.xpos[1], [2, 3, 0.5], atol=2e-3)
    assert data.contact.dist.min() > -1e-3


def test_meshes_lie_beside_the_file(chair: Export, tmp_path: Path) -> None:
    files = save_export(chair, tmp_path / "chair.sdf")
    uris = {element.text for element in ElementTree.parse(files[0]).iter("uri")}
    assert uris == {"chair_visual.obj"}
    assert all((tmp_path / str(uri)).is_file() for uri in uris)


def test_a_room_is_a_world_with_a_floor(room: Export, tmp_path: Path) -> None:
    files = save_export(room, tmp_path / "room.sdf")
    world = ElementTree.parse(files[0]).getroot().find("world")
    assert world is not None
    models = {model.get("name"): pose_of(model)[0] for model in world.iterfind("model")}
    assert set(models) == {"floor", "chair_0", "chair_1"}
    np.testing.assert_allclose(models["chair_1"], [4, 3, 0.5], atol=1e-6)
    np.testing.assert_allclose(models["floor"], [0, 0, 0.5], atol=1e-6)
