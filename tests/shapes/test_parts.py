"""Parts of meshes: what hangs together, labels, and joining of the smallest."""

import numpy as np
import pytest
import trimesh

from kpred.shapes.mesh import Mesh
from kpred.shapes.parts import part_labels
from kpred.synthetic.generator import generate


def _boxes(places: list[tuple[float, float, float]], sizes: list[float]) -> Mesh:
    made = [
        trimesh.creation.box([size] * 3, transform=trimesh.transformations.translation_matrix(place))
        for place, size in zip(places, sizes, strict=True)
    ]
    whole = trimesh.util.concatenate(made)
    return Mesh(whole.vertices, whole.faces)


def test_every_box_of_an_assembly_is_a_part_even_if_boxes_touch() -> None:
    mesh = _boxes([(0, 0, 0), (1, 0, 0), (0, 3, 0)], [1, 1, 1])
    labels = part_labels(mesh, 10)
    assert [len(set(labels[i * 12 : (i + 1) * 12].tolist())) for i in range(3)] == [1, 1, 1]
    assert sorted(np.bincount(labels).tolist()) == [12, 12, 12]


def test_triangles_without_common_vertices_are_told_apart_by_place() -> None:
    mesh = _boxes([(0, 0, 0), (3, 0, 0)], [1, 1])
    soup = Mesh(mesh.vertices[mesh.faces].reshape(-1, 3), np.arange(3 * len(mesh.faces)).reshape(-1, 3))
    assert (part_labels(soup, 10) == part_labels(mesh, 10)).all()


def test_labels_of_the_mesh_cut_what_hangs_together() -> None:
    mesh = _boxes([(0, 0, 0)], [1])
    given = (np.arange(12) < 5).astype(np.int16)
    labels = part_labels(Mesh(mesh.vertices, mesh.faces, face_parts=given), 10)
    assert len(set(labels[:5].tolist())) == len(set(labels[5:].tolist())) == 1
    assert labels[0] != labels[-1]


def test_the_smallest_are_joined_to_their_neighbours() -> None:
    mesh = _boxes([(0, 0, 0), (0.6, 0, 0), (9, 0, 0), (9.6, 0, 0)], [1, 0.1, 1, 0.1])
    labels = part_labels(mesh, 2)
    assert set(labels[:24].tolist()) != set(labels[24:].tolist())
    assert len(set(labels[:24].tolist())) == len(set(labels[24:].tolist())) == 1


@pytest.mark.parametrize("category", ["chair", "cabinet"])
def test_parts_number_from_zero_and_keep_labels_apart(category: str) -> None:
    for mesh in generate(category, 6, seed=5):
        for max_parts in (1, 4, 24):
            labels = part_labels(mesh, max_parts)
            assert sorted(set(labels.tolist())) == list(range(labels.max() + 1))
            assert labels.max() < max_parts
        assert (part_labels(mesh, 24) == part_labels(mesh, 24)).all()
        finest = part_labels(mesh, 1000)
        for part in range(finest.max() + 1):
            assert len(set(mesh.face_parts[finest == part].tolist())) == 1
