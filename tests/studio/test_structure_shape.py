"""Corrections of a shape that keeps structure: what is demanded is met, the rest stays or follows as CAD does."""

import numpy as np
import pytest

from kpred.errors import ConfigError
from kpred.studio.gestures import WHOLE
from kpred.studio.shape import Held
from kpred.studio.structure_shape import THIN, StructureShape

HEIGHT = 1


def _thin(shape: StructureShape) -> list[int]:
    count = shape.model.basis.structure.parts
    return [part for part in range(count) if shape.sizes(part)[HEIGHT] < THIN]


def _long(shape: StructureShape) -> list[int]:
    count = shape.model.basis.structure.parts
    height = shape.sizes(WHOLE)[HEIGHT]
    return [part for part in range(count) if shape.sizes(part)[HEIGHT] > 0.7 * height]


@pytest.mark.parametrize("factor", [0.85, 1.12])
def test_a_higher_table_has_longer_legs_and_the_same_top(table: StructureShape, factor: float) -> None:
    height = table.sizes(WHOLE)[HEIGHT]
    higher = table.resize(WHOLE, HEIGHT, factor * height, Held())
    assert higher.sizes(WHOLE)[HEIGHT] == pytest.approx(factor * height, rel=0.005)
    thin, long = _thin(table), _long(table)
    assert thin and len(long) >= 4
    for part in thin:
        assert higher.sizes(part)[HEIGHT] == pytest.approx(table.sizes(part)[HEIGHT], rel=0.02)
    for part in long:
        grown = higher.sizes(part)[HEIGHT] - table.sizes(part)[HEIGHT]
        assert grown == pytest.approx((factor - 1) * height, rel=0.1)
    # It still stands where it stood, and nothing changed to the sides.
    assert higher.vertices[:, HEIGHT].min() == pytest.approx(table.vertices[:, HEIGHT].min(), abs=1e-3)
    np.testing.assert_allclose(higher.vertices[:, [0, 2]], table.vertices[:, [0, 2]], atol=1e-6)


def test_a_size_out_of_reach_is_refused(table: StructureShape) -> None:
    with pytest.raises(ConfigError, match="cannot be reached"):
        table.resize(WHOLE, HEIGHT, 40.0, Held())


@pytest.mark.parametrize("keypoint", range(12))
def test_a_dragged_keypoint_follows_the_hand(table: StructureShape, keypoint: int) -> None:
    place = table.keypoints[keypoint] + [0.0, 0.08, 0.0]
    moved = table.pull((keypoint,), Held())(place[None])
    assert moved.keypoints[keypoint, HEIGHT] == pytest.approx(place[HEIGHT], abs=0.02)


def test_a_drag_back_to_the_start_changes_nothing(table: StructureShape) -> None:
    same = table.pull((2,), Held())(table.keypoints[[2]])
    np.testing.assert_allclose(same.vertices, table.vertices, atol=1e-9)


def test_a_drag_keeps_pinned_keypoints_and_typed_sizes(table: StructureShape) -> None:
    keypoints = table.keypoints
    dragged = int(keypoints[:, HEIGHT].argmax())
    pinned = int(keypoints[:, HEIGHT].argmin())
    part = _long(table)[0]
    held = Held({pinned: keypoints[pinned]}, {(part, 0): float(table.sizes(part)[0])})
    moved = table.pull((dragged,), held)(keypoints[[dragged]] + [0.1, 0.1, 0.0])
    np.testing.assert_allclose(moved.keypoints[pinned], keypoints[pinned], atol=0.01)
    assert moved.sizes(part)[0] == pytest.approx(table.sizes(part)[0], rel=0.02)


def test_planar_facets_stay_planar_however_far_a_keypoint_is_dragged(table: StructureShape) -> None:
    moved = table.pull((0,), Held())(table.keypoints[[0]] + [3.0, 3.0, -3.0])
    assert np.isfinite(moved.vertices).all()
    for part in range(table.model.basis.structure.parts):
        mine = table.model.vertices.parts == part
        before, after = table.vertices[mine], moved.vertices[mine]
        for axis in range(3):
            # Vertices of one height before are of one height after, and their order is the same: nothing folds.
            order = np.argsort(before[:, axis], kind="stable")
            assert np.diff(after[order, axis])[np.diff(before[order, axis]) > 1e-4].min(initial=0.0) >= -1e-6


def test_refitting_goes_to_the_scan_and_keeps_what_is_held(table: StructureShape) -> None:
    height = float(table.sizes(WHOLE)[HEIGHT])
    goal = table.resize(WHOLE, HEIGHT, 1.08 * height, Held())
    points = goal.model.samples.moved(goal.solution)
    free = table.refit(points, Held())
    assert free.sizes(WHOLE)[HEIGHT] == pytest.approx(1.08 * height, rel=0.01)
    held = table.refit(points, Held(sizes={(WHOLE, HEIGHT): height}))
    assert held.sizes(WHOLE)[HEIGHT] == pytest.approx(height, rel=0.01)
    pin = int(table.keypoints[:, HEIGHT].argmax())
    pinned = table.refit(points, Held({pin: table.keypoints[pin]}))
    np.testing.assert_allclose(pinned.keypoints[pin], table.keypoints[pin], atol=0.01)
