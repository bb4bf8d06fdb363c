"""URDF loads in MuJoCo with its meshes beside it; the link stands on its origin."""

from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from kpred.exports.formats import save_export
from kpred.exports.furniture import Export
from kpred.shapes import read_mesh


def test_a_chair_is_a_link_with_its_mass(chair: Export, tmp_path: Path) -> None:
    mujoco = pytest.importorskip("mujoco")
    files = save_export(chair, tmp_path / "chair.urdf")
    model = mujoco.MjModel.from_xml_path(str(files[0]))
    assert sum(model.geom_contype) == 6
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    lowest = min(
        data.geom_xpos[number][2] - np.abs(data.geom_xmat[number].reshape(3, 3)[2]) @ model.geom_size[number]
        for number in range(model.ngeom)
    )
    assert lowest == pytest.approx(0, abs=1e-6)


def test_the_surface_stands_on_the_origin_and_faces_x(chair: Export, tmp_path: Path) -> None:
    files = save_export(chair, tmp_path / "chair.urdf")
    tree = ElementTree.parse(files[0])
    names = {element.get("filename") for element in tree.iter("mesh")}
    assert names <= {file.name for file in files}
    found = read_mesh(tmp_path / "chair_visual.obj")
    np.testing.assert_allclose(found.bounds, [[-0.25, -0.25, 0], [0.25, 0.25, 1.0725]], atol=1e-6)
    high = found.vertices[found.vertices[:, 2] > 0.6]
    assert high[:, 0].max() < 0  # The back is at the back.


def test_a_room_is_one_robot(room: Export, tmp_path: Path) -> None:
    mujoco = pytest.importorskip("mujoco")
    files = save_export(room, tmp_path / "room.urdf")
    model = mujoco.MjModel.from_xml_path(str(files[0]))
    places = [model.body(name).pos for name in ("chair_0", "chair_1")]
    np.testing.assert_allclose(places, [[2, 3, 0.5], [4, 3, 0.5]], atol=1e-6)


def test_places_far_from_the_origin_are_exact(room: Export, tmp_path: Path) -> None:
    far = np.array([694_386_212.3, 5_155_487_512.7, 381_036.0])
    objects = tuple(replace(one, vertices=one.vertices + far) for one in room.objects)
    file, *_ = save_export(replace(room, objects=objects), tmp_path / "room.urdf")
    places = [
        [float(x) for x in one.find("origin").get("xyz").split()] for one in ElementTree.parse(file).iter("joint")
    ]
    np.testing.assert_allclose(places, np.array([[2, 3, 0.5], [4, 3, 0.5]]) + far / 1000, atol=1e-5, rtol=0)
