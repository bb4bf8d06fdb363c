"""Equal things share one model, each in its own place; others keep their own."""

from dataclasses import replace

import numpy as np
import pytest

import kpred
from kpred.fitting.defaults import sample_scan
from kpred.fitting.equal_objects import share_models
from kpred.fitting.object_fit import ObjectFit
from kpred.ops.rotations import yaw_rotation
from kpred.scenes.objects import SceneObject


@pytest.fixture(scope="module")
def chair() -> ObjectFit:
    """The sample chair, the surest result of its room."""
    found = kpred.fit(sample_scan(), up="y")
    item = SceneObject("chair_1", "chair", found.points, np.arange(len(found.points)), "y", score=0.9)
    return ObjectFit(item, found)


def another(chair: ObjectFit, size: float, angle: float = 0.9) -> ObjectFit:
    """A less sure result of the same scan, rotated and moved, whose own model is wider by `size`."""
    assert chair.fit is not None
    moved = chair.rotated(yaw_rotation(angle)).moved(np.array([2.0, 0.0, 1.0]))
    assert moved.fit is not None
    middle = moved.fit.mesh.bounds.mean(axis=0)
    mesh = moved.fit.mesh.copy()
    mesh.vertices = (mesh.vertices - middle) * [size, 1.0, size] + middle
    points = (moved.fit.points + [2.0, 0.0, 1.0] - middle) * [
        max(1.0, size - 0.06),
        1.0,
        max(1.0, size - 0.06),
    ] + middle
    fit = replace(moved.fit, mesh=mesh, points=points)
    return replace(moved, object=replace(moved.object, name="chair_2", score=0.5), fit=fit)


def test_an_equal_object_gets_the_surer_ones_model_in_its_own_place(chair: ObjectFit) -> None:
    other = another(chair, 1.06)
    first, second = share_models([chair, other], "y", 1.0)
    assert first is chair
    assert second.shares == "chair_1"
    assert second.fit is not None and other.fit is not None and chair.fit is not None
    true = np.asarray(chair.fit.mesh.vertices) @ yaw_rotation(0.9).T + [2.0, 0.0, 1.0]
    distance = np.linalg.norm(np.asarray(second.fit.mesh.vertices) - true, axis=1)
    assert distance.mean() < 0.02
    assert second.fit.points is other.fit.points
    assert second.to_json()["shares"] == "chair_1"
    np.testing.assert_allclose(second.cad_mesh().vertices, chair.cad_mesh().vertices, atol=1e-6)


def test_an_object_of_another_size_keeps_its_own_model(chair: ObjectFit) -> None:
    other = another(chair, 1.4)
    result = share_models([chair, other], "y", 1.0)
    assert result[1] is other


def test_the_order_and_the_axis_do_not_matter(chair: ObjectFit) -> None:
    other = another(chair, 1.06)
    to_z = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    result = share_models([other.rotated(to_z), chair.rotated(to_z)], "z", 1.0)
    assert [item.shares for item in result] == ["chair_1", None]
