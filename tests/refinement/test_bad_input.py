"""Meshes and scans that no one would call CAD: the fit ends, is finite, and folds nothing."""

import numpy as np
import pytest
import trimesh

from kpred.refinement.structure_config import StructureConfig
from kpred.refinement.structure_fit import StructureMap
from kpred.synthetic.parts import box


def union(meshes):
    mesh = trimesh.util.concatenate(meshes)
    return np.asarray(mesh.vertices), np.asarray(mesh.faces)


def block(size, middle=(0.0, 0.0, 0.0)):
    mesh = trimesh.creation.box(size)
    mesh.apply_translation(middle)
    return mesh


def blob():
    """A bumpy sphere: one curved part."""
    mesh = trimesh.creation.icosphere(subdivisions=3)
    bumps = 1 + 0.2 * np.sin(5 * mesh.vertices[:, 0]) * np.cos(4 * mesh.vertices[:, 1])
    return np.asarray(mesh.vertices) * bumps[:, None], np.asarray(mesh.faces)


def crowd():
    """Three thousand small boxes in a lattice."""
    lattice = np.stack(np.meshgrid(*[np.arange(n) for n in (15, 20, 10)]), axis=-1).reshape(-1, 3)
    return union([block((0.6, 0.6, 0.6), middle) for middle in lattice])


def nested():
    """Boxes inside boxes, of one middle."""
    return union([block((side, 1.2 * side, 0.8 * side)) for side in (1.0, 0.7, 0.4, 0.1)])


def sheets():
    """Boards without any thickness, two of them upright."""
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    places = [square, square + [0, 0.8, 0], square[:, [1, 0, 2]], square[:, [1, 0, 2]] + [1, 0, 0]]
    return np.vstack(places), np.vstack([faces + 4 * k for k in range(4)])


def lopsided():
    """Nothing mirrors anything."""
    return union(
        [block((1, 0.1, 0.4)), block((0.1, 0.7, 0.1), (0.4, -0.3, 0.1)), block((0.2, 0.5, 0.3), (-0.2, 0.3, 0))]
    )


def inconsistent():
    """A table whose faces are wound at random."""
    vertices, faces = union([block((1, 0.1, 0.6)), *[block((0.1, 0.8, 0.1), (x, -0.45, 0)) for x in (-0.4, 0.4)]])
    flipped = np.random.default_rng(0).random(len(faces)) < 0.5
    return vertices, np.where(flipped[:, None], faces[:, ::-1], faces)


def fine_facet():
    """A board of 100,000 triangles."""
    count = 223
    x, z = (grid.reshape(-1) for grid in np.meshgrid(np.linspace(0, 1, count + 1), np.linspace(0, 1, count + 1)))
    corner = (np.arange(count)[:, None] * (count + 1) + np.arange(count)).reshape(-1)
    faces = [np.column_stack([corner, corner + count + 1, corner + 1])]
    faces.append(np.column_stack([corner + 1, corner + count + 1, corner + count + 2]))
    top = np.column_stack([x, np.full(len(x), 0.1), z])
    leg = block((0.1, 0.6, 0.1), (0.5, -0.25, 0.5))
    return np.vstack([top, leg.vertices]), np.vstack([*faces, leg.faces + len(top)])


def degenerate():
    """A box with triangles of no area, vertices that no face uses, and a face twice."""
    vertices, faces = union([block((1, 0.6, 0.8))])
    extra = np.array([[0, 0, 1], [2, 2, 2], [0, 1, 1]])
    return np.vstack([vertices, [[0.2, 0.1, 0.3]]]), np.vstack([faces, extra, faces[:1]])


MESHES = [blob, crowd, nested, sheets, lopsided, inconsistent, fine_facet, degenerate]


@pytest.fixture(scope="module")
def made(of_mesh):
    """All of them, analysed once."""
    return {one.__name__: of_mesh(*one()) for one in MESHES}


@pytest.mark.parametrize("name", [one.__name__ for one in MESHES])
@pytest.mark.parametrize("kind", ["stretched", "half", "noise"])
def test_any_mesh_is_fitted_without_folds(made, name, kind, rng):
    case = made[name]
    size = np.array([1.2, 0.8, 0.9])
    goal = case.scan(case.vertices * size)
    if kind == "half":
        goal = goal[goal[:, 2] > np.median(goal[:, 2])]
    if kind == "noise":
        goal = goal + rng.normal(0, 0.02, goal.shape).astype(np.float32)
    found = case.fit(goal, lambda places: (places[:, 2] > 0).astype(float) if kind == "half" else np.ones(len(places)))
    result = case.moved(found)
    assert np.isfinite(found.solution).all() and np.isfinite(result).all()
    assert np.abs(result).max() < 2
    cleanliness = case.cleanliness(result)
    assert cleanliness.folded_faces == 0
    assert cleanliness.flatness < 1e-3
    assert (found.growth() > 0).all()


def test_a_blob_stretches_as_a_whole(made):
    case = made["blob"]
    goal = case.scan(case.vertices * [1.2, 0.8, 0.9])
    assert case.structure.parts == 1 and case.structure.curved.all()
    np.testing.assert_allclose(np.ptp(case.moved(case.fit(goal)), axis=0), np.ptp(goal, axis=0), atol=0.04)


SCANS = {
    "one point": np.zeros((1, 3)),
    "two points": np.array([[0.0, 0, 0], [0.1, 0, 0]]),
    "one place": np.full((500, 3), 0.2),
    "far away": np.random.default_rng(0).normal(50.0, 0.1, (500, 3)),
    "a line": np.linspace(-0.5, 0.5, 600)[:, None] * [1.0, 0.0, 0.0],
    "clutter": np.random.default_rng(0).uniform(-2, 2, (2000, 3)),
}


@pytest.mark.parametrize("name", SCANS)
@pytest.mark.parametrize("seen", [0.0, 1.0])
def test_any_scan_gives_a_finite_model(cases, name, seen):
    case = cases["chair"]
    found = case.fit(SCANS[name].astype(np.float32), lambda places: np.full(len(places), seen), floor=-0.5)
    result = case.moved(found)
    assert np.isfinite(result).all()
    assert case.cleanliness(result).folded_faces == 0
    assert (found.growth() > 0.2).all()


def test_few_points_of_a_model_are_enough(of_mesh):
    case = of_mesh(*lopsided(), count=20)
    assert np.isfinite(case.moved(case.fit(case.scan(case.vertices)))).all()


@pytest.mark.parametrize("rounds", [0, 1, 2])
def test_few_rounds(cases, rounds):
    case = cases["chair"]
    result = case.moved(case.fit(case.scan(case.vertices), config=StructureConfig(iterations=rounds)))
    assert np.isfinite(result).all()
    assert np.abs(result - case.vertices).max() < 0.05


def test_no_points_are_moved_nowhere(cases):
    case = cases["chair"]
    zero = StructureMap(case.model.basis, np.zeros((3, case.model.basis.unknowns)))
    assert zero(np.zeros((0, 3)), np.zeros(0, np.int32)).shape == (0, 3)


def test_one_box_is_one_part(build):
    case = build([box((1.0, 0.5, 0.3), (0.0, 0.0, 0.0), "box")])
    goal = case.scan(case.vertices * [0.9, 1.2, 1.1])
    assert case.structure.parts == 1
    np.testing.assert_allclose(case.moved(case.fit(goal)), case.vertices * [0.9, 1.2, 1.1], atol=0.02)
