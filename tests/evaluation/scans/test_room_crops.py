"""Crops of virtual rooms as targets: the truth fits the scan, a true result is right, a turned one is not."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree

from kpred.evaluation.database_source import database_source
from kpred.evaluation.metrics.symmetry import NONE, yaw_between, yaw_error
from kpred.evaluation.scans.outcome import FitSettings
from kpred.evaluation.scans.room_crops import KIND, CropTarget, collect_crop_samples, draw_crop_targets
from kpred.nn import Model
from kpred.ops.rotations import yaw_rotation
from kpred.synthetic.rooms.generate import generate_rooms
from kpred.synthetic.rooms.pack import RoomPack


@pytest.fixture(scope="module")
def rooms() -> RoomPack:
    return generate_rooms(2, 8, scanner="mesh", points=15_000)


@pytest.fixture(scope="module")
def targets(rooms: RoomPack) -> list[CropTarget]:
    return list(draw_crop_targets([rooms], ("chair", "table"), 24, 0.25, 1))


def result(target: CropTarget, turn: float = 0.0) -> tuple[np.ndarray, trimesh.Trimesh]:
    """Rotation and mesh of a result that is the whole surface itself, in tiny triangles, turned by degrees."""
    rotation = yaw_rotation(np.radians(turn))
    place = target.frame.from_unit(target.whole @ rotation)
    vertices = (place[:, None] + 1e-4 * np.eye(3)[None]).reshape(-1, 3)
    mesh = trimesh.Trimesh(vertices, np.arange(len(vertices)).reshape(-1, 3), process=False)
    return rotation @ target.frame.rotation, mesh


def test_scans_lie_on_their_surfaces(targets: list[CropTarget]) -> None:
    assert {target.category for target in targets} == {"chair", "table", "other"}
    for target in targets:
        away = cKDTree(target.whole).query(target.frame.to_unit(target.scan))[0]
        # Up to 15 % of the points are a neighbour's.
        assert np.quantile(away, 0.8) < 0.25
        assert len(np.unique(target.scan, axis=0)) == len(target.scan)


def test_targets_depend_on_the_seed_alone(rooms: RoomPack, targets: list[CropTarget]) -> None:
    again = list(draw_crop_targets([rooms], ("chair", "table"), 24, 0.25, 1))
    for one, other in zip(again, targets, strict=True):
        np.testing.assert_array_equal(one.scan, other.scan)


def test_the_truth_is_right_and_what_is_turned_or_named_otherwise_is_not(targets: list[CropTarget]) -> None:
    chosen = [target for target in targets if target.category == "chair" and target.symmetry == NONE]
    assert chosen
    for target in chosen:
        assert target.accepts("chair", *result(target))
        assert not target.accepts("table", *result(target))
        rotation, mesh = result(target, 40.0)
        assert yaw_error(yaw_between(rotation, target.frame.rotation), NONE) == pytest.approx(40.0)
        assert not target.accepts("chair", rotation, mesh)


def test_crops_are_fitted(rooms: RoomPack, packs: dict[str, Path], model: Model) -> None:
    with database_source(list(packs.values()), model, None, 0, None, pytest.fail) as database:
        settings = FitSettings(model, database, 1, 0)
        remarks: list[str] = []
        samples = collect_crop_samples([rooms], settings, limit=3, report=remarks.append)
    assert len(samples) + len(remarks) == 3
    assert all(sample.kind == KIND for sample in samples)
    facts: list[dict[str, Any]] = [sample.to_json() for sample in samples]
    assert all(row["category"] in ("chair", "table", "other") for row in facts)
