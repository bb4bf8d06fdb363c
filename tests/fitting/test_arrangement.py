"""Results of a room put together: on the floor, apart, one for each thing."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

import kpred
from kpred.fitting.arrangement import arrange, floor_gap, interpenetration
from kpred.fitting.defaults import sample_scan
from kpred.fitting.object_fit import ObjectFit
from kpred.scenes.floor import SceneFloor
from kpred.scenes.objects import SceneObject

FLOOR = SceneFloor("y", 0.0, np.zeros(2), "points")


@pytest.fixture(scope="module")
def chair() -> ObjectFit:
    """The sample chair, 3 cm above a floor at height 0."""
    found = kpred.fit(sample_scan(), up="y")
    size = np.ptp(found.mesh.vertices, axis=0)
    assert 0.5 < size[1] < 1.5
    points = np.asarray(found.mesh.vertices)
    item = SceneObject("chair_1", "chair", points, np.arange(len(points)), "y", score=0.9)
    fitted = ObjectFit(item, found, floor=0.0)
    low = np.asarray(found.mesh.vertices).min(axis=0)
    return fitted.moved(np.array([0.0, 0.03 - low[1], 0.0]))


def beside(chair: ObjectFit, distance: float, score: float) -> ObjectFit:
    width = float(np.ptp(chair.fit.mesh.vertices[:, 0])) if chair.fit else 0.0
    moved = chair.moved(np.array([width + distance, 0.0, 0.0]))
    return replace(moved, object=replace(moved.object, name="chair_2", score=score))


def test_what_hovers_is_set_on_the_floor(chair: ObjectFit) -> None:
    assert floor_gap(chair, "y", 1.0) == pytest.approx(0.03)
    (result,) = arrange([chair], "y", FLOOR, 1.0)
    assert floor_gap(result, "y", 1.0) == pytest.approx(0.0, abs=1e-9)
    assert result.fit is not None
    assert chair.fit is not None
    np.testing.assert_allclose(result.fit.frame.center - chair.fit.frame.center, [0.0, -0.03, 0.0], atol=1e-12)
    np.testing.assert_allclose(result.cad_to_scan()[:3, :3], chair.cad_to_scan()[:3, :3])


def test_results_that_stand_in_each_other_are_parted(chair: ObjectFit) -> None:
    pairs = ([chair, beside(chair, -step / 50, 0.5)] for step in range(20))
    pair = next(pair for pair in pairs if interpenetration(pair, "y", 1.0) > 0.006)
    result = arrange(pair, "y", FLOOR, 1.0)
    assert all(item.fit is not None for item in result)
    assert interpenetration(result, "y", 1.0) < 0.005
    first, second = (np.asarray(item.fit.mesh.vertices).min(axis=0) for item in result if item.fit)
    np.testing.assert_allclose(first[[0, 2]], np.asarray(chair.fit.mesh.vertices).min(axis=0)[[0, 2]])  # type: ignore[union-attr]
    assert np.linalg.norm((second - np.asarray(pair[1].fit.mesh.vertices).min(axis=0))[[0, 2]]) < 0.15  # type: ignore[union-attr]


def test_of_two_results_of_one_thing_the_surer_one_stays(chair: ObjectFit) -> None:
    twin = beside(chair, -float(np.ptp(chair.fit.mesh.vertices[:, 0])) + 0.05, 0.95)  # type: ignore[union-attr]
    result = arrange([chair, twin], "y", FLOOR, 1.0)
    assert result[0].fit is None
    assert result[0].error is not None
    assert "chair_2" in result[0].error
    assert result[1].fit is not None


def test_results_apart_stay_where_they_are(chair: ObjectFit) -> None:
    pair = [chair, beside(chair, 0.5, 0.5)]
    result = arrange(pair, "y", None, 1.0)
    for before, after in zip(pair, result, strict=True):
        np.testing.assert_allclose(before.cad_to_scan(), after.cad_to_scan())


def test_a_result_is_moved_off_a_wall_that_was_seen(chair: ObjectFit) -> None:
    assert chair.fit is not None
    block = trimesh.creation.box([0.6, 0.8, 0.4])
    block.apply_translation([0.0, 0.4, 0.0])
    cabinet = replace(chair, fit=replace(chair.fit, mesh=block))
    y, x = np.meshgrid(np.arange(0.0, 1.2, 0.01), np.arange(-1.0, 1.0, 0.01))
    wall = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, -0.1)])
    own = np.asarray(block.sample(2000, seed=0))
    cabinet = replace(cabinet, object=replace(cabinet.object, points=own, indices=np.arange(2000)))
    (still,) = arrange([cabinet], "y", FLOOR, 1.0)
    (moved,) = arrange([cabinet], "y", FLOOR, 1.0, np.concatenate([own, wall]))
    assert still.fit is not None and moved.fit is not None
    np.testing.assert_allclose(still.fit.mesh.bounds, cabinet.fit.mesh.bounds)  # type: ignore[union-attr]
    assert -0.16 < moved.fit.mesh.bounds[0, 2] < -0.09
