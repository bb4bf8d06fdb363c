"""Measures of parts and shapes that laws of several generators are about."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from kpred.shapes.mesh import Mesh
from kpred.synthetic.part import Part


@pytest.fixture(scope="session")
def volume() -> Callable[[Part], float]:
    """Volume of a closed part."""

    def measured(part: Part) -> float:
        corners = part.vertices[part.faces] - part.vertices.mean(axis=0)
        return float(np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0)

    return measured


@pytest.fixture(scope="session")
def is_closed() -> Callable[[Part], bool]:
    """Whether each edge is used once in each direction."""

    def checked(part: Part) -> bool:
        first = part.faces.astype(np.int64).ravel()
        second = np.roll(part.faces, -1, axis=1).astype(np.int64).ravel()
        count = len(part.vertices)
        used = np.sort(first * count + second)
        return bool((np.diff(used) > 0).all() and np.array_equal(used, np.sort(second * count + first)))

    return checked


@pytest.fixture(scope="session")
def upper_z() -> Callable[[Mesh], float]:
    """Mean z of the surface in the upper two fifths of a shape."""

    def measured(mesh: Mesh) -> float:
        areas, centers = mesh.face_areas(), mesh.vertices[mesh.faces].mean(axis=1)
        upper = centers[:, 1] > 0.6 * mesh.bounds[1, 1]
        return float(np.average(centers[upper, 2], weights=areas[upper]))

    return measured
