"""MJCF loads in MuJoCo; furniture stands on the floor for 30 seconds, and nothing penetrates at rest."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import kpred
from kpred.exports.formats import save_export
from kpred.exports.furniture import Export

mujoco = pytest.importorskip("mujoco")

SECONDS = 30.0
MAX_DEPTH, MAX_FALL = 1e-3, 5e-3
"""Metres by which a collider may be in another, and by which furniture may sink or rise, at rest."""


def run(model: Any) -> Any:
    data = mujoco.MjData(model)
    for _ in range(int(SECONDS / model.opt.timestep)):
        mujoco.mj_step(model, data)
    return data


def is_upright(rotation: np.ndarray) -> bool:
    return bool(rotation.reshape(3, 3)[2, 2] > np.cos(np.radians(2)))


def check_rest(model: Any, data: Any) -> None:
    start = mujoco.MjData(model)
    mujoco.mj_forward(model, start)
    assert start.ncon == 0 or start.contact.dist.min() > -1e-6
    assert data.ncon >= 3 and data.contact.dist.min() > -MAX_DEPTH
    assert np.abs(data.qvel).max() < 1e-3
    for body in range(1, model.nbody):
        assert np.abs(data.xpos[body] - start.xpos[body]).max() < MAX_FALL
        assert is_upright(data.xmat[body])


def test_a_chair_stands_where_it_was_scanned(chair: Export, tmp_path: Path) -> None:
    (file,) = save_export(chair, tmp_path / "chair.xml")
    model = mujoco.MjModel.from_xml_path(str(file))
    np.testing.assert_allclose(model.body("chair_0").pos, [2, 3, 0.5], atol=1e-6)
    np.testing.assert_allclose(model.geom("floor").pos[2], 0.5, atol=1e-6)
    # A box a part: 2 of 0.5 x 0.5 x 0.05 and four legs, the heights a tenth larger; kg of wood.
    volume = 1.1 * (2 * 0.5 * 0.5 * 0.05 + 4 * 0.05 * 0.425 * 0.05)
    np.testing.assert_allclose(model.body("chair_0").mass, 600 * volume, rtol=1e-5)
    check_rest(model, run(model))


def test_a_room_stands(room: Export, tmp_path: Path) -> None:
    (file,) = save_export(room, tmp_path / "room.mjcf")
    model = mujoco.MjModel.from_xml_path(str(file))
    assert model.nbody == 3
    check_rest(model, run(model))


def test_a_fitted_scan_stands(tmp_path: Path) -> None:
    fit = kpred.fit(kpred.sample_scan(), up="y", category="chair")
    fit.save(tmp_path / "chair.xml")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "chair.xml"))
    data = run(model)
    assert data.contact.dist.min() > -MAX_DEPTH
    assert is_upright(data.xmat[1])
    lowest, highest = fit.mesh.bounds[:, 1]
    colliders = [number for number in range(model.ngeom) if model.geom_contype[number]]
    assert len(colliders) - 1 == fit.placed.entry.structure.parts
    assert data.xpos[1][2] == pytest.approx(lowest, abs=0.03 * (highest - lowest))
    assert np.abs(data.qvel).max() < 1e-2
