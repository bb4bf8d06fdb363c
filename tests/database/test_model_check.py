"""Catalogues that lie on their backs, and meshes that hold more than furniture, are noticed."""

import numpy as np
import pytest
import trimesh

from kpred.database.model_check import ModelCheck
from kpred.database.orientation_check import up_rotation
from kpred.nn import Recognizer, load_model
from kpred.shapes.helper_parts import helper_part
from kpred.shapes.mesh import Mesh
from kpred.shapes.source import Shape
from kpred.synthetic.generator import generate


@pytest.fixture(scope="module")
def shapes() -> list[Shape]:
    found = []
    for category in ("chair", "table", "cabinet"):
        pack = generate(category, 3, seed=3, splits=False)
        found += [Shape(f"{category}{i}", category, "source", pack[i]) for i in range(3)]
    return found


@pytest.fixture(scope="module")
def recognizer() -> Recognizer | None:
    return load_model().recognizer


def rotated(shape: Shape, rotation: np.ndarray) -> Shape:
    return shape._replace(mesh=Mesh(shape.mesh.vertices @ rotation.T, shape.mesh.faces))


@pytest.mark.parametrize("axis", ["z", "-z", "-y", "y"])
def test_the_up_axis_of_a_catalogue_is_recognized(
    shapes: list[Shape], recognizer: Recognizer | None, axis: str
) -> None:
    lying = [rotated(shape, up_rotation(axis).T) for shape in shapes]
    # A cabinet that stands on its head is a cabinet still.
    for category in ("chair", "table") if axis == "-y" else ("chair", "table", "cabinet"):
        check = ModelCheck(recognizer)
        list(check.watch(shape for shape in lying if shape.category == category))
        if axis == "y":
            assert check.warnings() == []
        else:
            assert len(check.warnings()) == 1 and "not y; build again with --up" in check.warnings()[0]
    stood_up = ModelCheck(recognizer, up=axis)
    for before, after in zip(shapes, stood_up.watch(lying), strict=True):
        np.testing.assert_allclose(after.mesh.vertices, before.mesh.vertices, atol=1e-6)
    assert stood_up.warnings() == []


@pytest.mark.parametrize("axis", ["x", "y", "z", "-x", "-y", "-z"])
def test_up_rotations_are_rotations_that_take_their_axis_to_y(axis: str) -> None:
    rotation = up_rotation(axis)
    up = np.eye(3)["xyz".index(axis[-1])] * (-1 if axis.startswith("-") else 1)
    np.testing.assert_allclose(rotation @ up, [0, 1, 0])
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3))
    assert np.linalg.det(rotation) == pytest.approx(1)


def joined(mesh: Mesh, other: trimesh.Trimesh) -> Mesh:
    vertices = np.concatenate([mesh.vertices, other.vertices])
    return Mesh(vertices, np.concatenate([mesh.faces, other.faces + len(mesh.vertices)]))


def test_shadow_planes_and_helpers_are_noticed_and_furniture_is_not(shapes: list[Shape]) -> None:
    for shape in shapes:
        low, high = shape.mesh.bounds.astype(float)
        assert helper_part(shape.mesh) is None
        middle, size = (low + high) / 2, high - low
        plane = trimesh.creation.box((2 * size[0], 1e-4, 2 * size[2]))
        plane.apply_translation([middle[0], low[1], middle[2]])
        assert "a shadow plane or a floor?" in str(helper_part(joined(shape.mesh, plane)))
        light = trimesh.creation.icosphere(0, 0.01)
        light.apply_translation(middle + 5 * np.linalg.norm(size))
        assert "far from the rest" in str(helper_part(joined(shape.mesh, light)))
    check = ModelCheck(None)
    list(check.watch([Shape("chair7", "chair", "source", joined(shapes[0].mesh, plane))]))
    assert "chair7: a" in check.warnings()[0]
