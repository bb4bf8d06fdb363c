"""Straight feature edges and dihedral angles: what counts, and by how much."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from kpred.shapes.structure.edge_changes import EdgeChanges, measure_edges
from kpred.shapes.structure.edge_pairs import face_frames
from kpred.shapes.structure.facets import weld


def _measure(source: np.ndarray, result: np.ndarray, faces: np.ndarray) -> EdgeChanges:
    frames = face_frames(source, faces, 1e-5), face_frames(result, faces, 1e-5)
    return measure_edges(source, result, faces, frames, weld(source, 1e-5))


@pytest.mark.parametrize("sections", [32, 720])
def test_only_straight_feature_edges_count_for_straightness(sections: int) -> None:
    mesh = trimesh.creation.cylinder(0.5, 1.0, sections=sections)
    vertices, faces = np.array(mesh.vertices), np.array(mesh.faces)
    widened = vertices * np.where(vertices[:, 2:] > 0, [1.5, 1.5, 1.0], 1.0)
    assert _measure(vertices, widened, faces).straightness < 1e-9


@pytest.mark.parametrize("soup", [False, True])
def test_straightness_is_the_distance_to_the_best_lines_of_chains(soup: bool) -> None:
    mesh = trimesh.creation.box((0.2, 0.3, 1.0)).subdivide().subdivide()
    vertices, faces = np.array(mesh.vertices), np.array(mesh.faces)
    if soup:
        vertices, faces = vertices[faces].reshape(-1, 3), np.arange(3 * len(faces)).reshape(-1, 3)
    bent = vertices + np.outer(0.4 * vertices[:, 2] ** 2, [1, 0, 0])
    # The four edges along z bend alike, at five positions each; in a soup, those between hold twice the vertices.
    offset, weight = 0.4 * np.linspace(-0.5, 0.5, 5) ** 2, [1, 2, 2, 2, 1] if soup else None
    rms = np.sqrt(np.average((offset - np.average(offset, weights=weight)) ** 2, weights=weight))
    assert _measure(vertices, bent, faces).straightness == pytest.approx(rms * 4 / (4 + 4 * 0.2 + 4 * 0.3))


def test_the_border_of_a_sheet_is_a_feature() -> None:
    x, z = (grid.reshape(-1) for grid in np.meshgrid(np.linspace(0, 1, 5), np.linspace(0, 1, 5)))
    vertices = np.column_stack([x, np.zeros(25), z])
    cells = [5 * i + j for i in range(4) for j in range(4)]
    faces = np.array([f for c in cells for f in ([c, c + 1, c + 5], [c + 1, c + 6, c + 5])])
    bulged = vertices * (1 - 0.4 * (vertices[:, 2:] - 0.5) ** 2 * [1, 0, 0])
    # Of four borders, only that at x = 1 bends.
    offset = 0.4 * (np.linspace(0, 1, 5) - 0.5) ** 2
    assert _measure(vertices, bulged, faces).straightness == pytest.approx(offset.std() / 4)


@pytest.mark.parametrize(("before", "after"), [(150, 170), (170, 190), (90, 75), (200, 100), (350, 20)])
def test_dihedral_change_is_that_of_a_hinge(before: float, after: float) -> None:
    def hinge(degrees: float) -> np.ndarray:
        angle = np.radians(degrees)
        return np.array([[0, 0, 0], [0, 0, 1], [1, 0, 0.5], [np.cos(angle), np.sin(angle), 0.5]], float)

    faces = np.array([[0, 1, 2], [1, 0, 3]])
    source = hinge(before)
    measured = _measure(source, hinge(after), faces)
    change = abs(after - before)
    assert measured.dihedral_change == pytest.approx(min(change, 360 - change))
    assert measured.squareness == pytest.approx(change if before == 90 else 0, abs=1e-9)
    # An edge of three faces has no dihedral angle.
    three, third = np.vstack([source, [0, -1, 0]]), np.vstack([faces, [0, 1, 4]])
    opened = np.vstack([hinge(after), [0, -1, 0]])
    assert _measure(three, opened, third).dihedral_change == 0
