"""What a fit brings about: exact where the family holds the answer, clean always, level, closed, symmetric."""

from dataclasses import replace

import numpy as np
import pytest

from kpred.ops.nearest_cpu import nearest_of_one
from kpred.refinement.structure_config import StructureConfig
from kpred.refinement.structure_fit import Evidence, StructureModel, fit_structure
from kpred.shapes.structure.cleanliness import measure_cleanliness, thickness_ratios
from kpred.shapes.structure.part_maps import fit_part_maps, measure_shears, own_extents
from kpred.synthetic.assembly import assemble
from kpred.synthetic.generator import FAMILIES
from kpred.synthetic.generator import build as furniture
from kpred.synthetic.parts import box

SIZE, SHIFT = np.array([1.2, 0.85, 0.9]), np.array([0.03, -0.02, 0.05])
ALONG_AXES = ["table", "chair", "shelf", "round table", "curved chair"]


def stretched(places):
    return places * SIZE + SHIFT


def chamfer(one, other):
    a, b = (np.ascontiguousarray(cloud, np.float32) for cloud in (one, other))
    return float(nearest_of_one(a, b)[0].mean() + nearest_of_one(b, a)[0].mean())


def seen_from_above(case):
    """Whether places lie below no part's box."""

    def visible(places):
        hidden = np.zeros(len(places), bool)
        for low, high in case.structure.boxes:
            inside = (places[:, [0, 2]] > low[[0, 2]]) & (places[:, [0, 2]] < high[[0, 2]])
            hidden |= inside.all(axis=1) & (places[:, 1] < high[1])
        return 1.0 - hidden

    return visible


def test_all_models_have_one_layout_in_memory(case):
    """Code is compiled once for each layout: another model must not make a fit compile."""
    model = case.model
    columns, basis = model.columns(2), model.basis
    arrays = [*model._freedom, basis.middle, basis.half, basis.growth, basis.stiff, basis.lean_axis, basis.group]
    arrays += [columns.points, columns.normals, columns.spline, columns.own, columns.across, columns.facing]
    assert all(array.flags.c_contiguous for array in arrays)


def test_its_own_points_leave_a_model_as_it_is(case):
    found = case.fit(case.points.astype(np.float32), config=StructureConfig(points=len(case.points)))
    np.testing.assert_allclose(case.moved(found), case.vertices, atol=1e-5)


@pytest.mark.parametrize("name", ALONG_AXES)
def test_stretching_and_shifting_is_fitted_exactly(cases, name, rng):
    case = cases[name]
    goal = stretched(case.points).astype(np.float32)[rng.permutation(len(case.points))]
    config = StructureConfig(points=len(goal))
    result = case.moved(case.fit(goal, config=config, start=stretched(case.points)))
    np.testing.assert_allclose(result, stretched(case.vertices), atol=2e-5)


def test_another_sample_of_the_same_surface_changes_little(case):
    off = case.moved(case.fit(case.scan(case.vertices))) - case.vertices
    assert np.sqrt((off**2).sum(axis=1).mean()) < 0.02


@pytest.mark.parametrize("seed", range(3))
def test_a_stretched_copy_is_clean(case, seed):
    goal = case.scan(stretched(case.vertices), seed=seed)
    result = case.moved(case.fit(goal, start=stretched(case.points)))
    found = case.cleanliness(result)
    assert np.abs(result - stretched(case.vertices)).max() < 0.03
    assert found.flatness < 1e-6
    assert found.squareness_95 < 1e-3
    assert found.parallelism < 1e-3
    assert found.axis_tilt_95 < 1e-2
    assert found.mirror is not None and found.mirror < 1e-4
    assert found.contact_gap_95 < 0.015
    assert found.folded_faces == 0


def lopsided(case):
    """A scan that no symmetric model explains."""
    vertices = stretched(case.vertices)
    vertices[:, 1] += 0.06 * (vertices[:, 0] > 0.1)
    vertices[:, 0] += 0.05 * (vertices[:, 0] > 0.1) * vertices[:, 1]
    return vertices


@pytest.mark.parametrize("half", [False, True])
def test_symmetric_models_stay_symmetric(case, half):
    goal = case.scan(lopsided(case))
    if half:
        goal = goal[goal[:, 0] > 0]
    result = case.moved(case.fit(goal, lambda places: np.where(places[:, 0] > 0, 1.0, 0.0 if half else 1.0)))
    assert np.abs(result - case.vertices).max() > 0.02
    found = case.cleanliness(result).mirror
    assert found is not None and found < 1e-4


@pytest.mark.parametrize("kind", ["stretched", "lopsided"])
def test_contacts_do_not_open(case, kind):
    wanted = stretched(case.vertices) if kind == "stretched" else lopsided(case)
    found = case.cleanliness(case.moved(case.fit(case.scan(wanted), start=stretched(case.points))))
    assert found.contact_gap < 0.003


def test_legs_of_one_thickness_keep_one(cases):
    case = cases["table"]
    legs = np.flatnonzero(case.model.basis.standing)
    vertices = case.vertices.copy()
    for part in legs:
        mine = case.structure.vertex_parts == part
        middle = vertices[mine].mean(axis=0)
        # Those in front of the scan are twice as thick.
        vertices[mine] += (vertices[mine] - middle) * ([1, 0, 1] if middle[2] > 0 else [0, 0, 0])
    differences = []
    for repeat in (0.0, StructureConfig().repeat):
        config = StructureConfig(repeat=repeat)
        tied = type(case).of(case.vertices, case.faces, config=config)
        result = tied.moved(tied.fit(case.scan(vertices), config=config))
        sides = own_extents(result, case.structure.vertex_parts, case.structure.axes)[legs]
        differences.append(np.ptp(sides[:, [0, 2]], axis=0).max())
    assert differences[0] > 0.02 and differences[1] < 0.2 * differences[0]


def sole_heights(case, result):
    standing = np.flatnonzero(case.model.basis.standing)
    return np.array([result[case.structure.vertex_parts == part, 1].min() for part in standing])


@pytest.mark.parametrize("name", ["table", "chair", "splayed chair"])
@pytest.mark.parametrize("floor", [None, -0.5])
def test_feet_stay_level(cases, name, floor):
    case = cases[name]
    vertices = stretched(case.vertices)
    vertices[:, 1] -= 0.05 * np.minimum(vertices[:, 2], 0)
    heights = sole_heights(case, case.moved(case.fit(case.scan(vertices), floor=floor, start=stretched(case.points))))
    assert len(heights) == 4
    assert np.ptp(heights) < 2e-3


@pytest.mark.parametrize("name", ["table", "chair", "splayed chair"])
def test_a_floor_below_pulls_feet_down(cases, name):
    case = cases[name]
    floor = float(case.vertices[:, 1].min()) - 0.05
    goal = case.scan(case.vertices)
    without, standing = (sole_heights(case, case.moved(case.fit(goal, floor=at))).mean() for at in (None, floor))
    assert abs(standing - floor) < 0.015
    assert abs(standing - floor) < abs(without - floor) / 2


@pytest.mark.parametrize("name", ["table", "chair", "splayed chair"])
def test_feet_stand_on_the_floor(cases, name):
    case = cases[name]
    floor = float(case.vertices[:, 1].min())
    heights = sole_heights(case, case.moved(case.fit(case.scan(case.vertices), floor=floor)))
    assert np.abs(heights - floor).max() < 2e-3


@pytest.mark.parametrize("name", ["table", "round table"])
def test_a_board_seen_from_above_keeps_its_thickness(cases, name):
    case = cases[name]
    seen = seen_from_above(case)
    goal = case.scan(case.vertices, 6000)
    goal = np.ascontiguousarray(goal[seen(goal.astype(np.float64) + [0, 0.02, 0]) > 0])
    result = case.moved(case.fit(goal + np.float32([0, 0.02, 0]), lambda places: seen(places - [0, 0.02, 0])))
    top = int(case.structure.boxes[:, 1, 1].argmax())
    assert abs(thickness_ratios(case.vertices, result, case.structure, 1.0)[top] - 1) < 0.1
    assert result[:, 1].max() > case.vertices[:, 1].max() + 0.01


@pytest.mark.parametrize("name", ["table", "shelf"])
def test_a_board_seen_from_all_sides_keeps_its_thickness(cases, name):
    case = cases[name]
    result = case.moved(case.fit(case.scan(case.vertices)))
    assert np.abs(thickness_ratios(case.vertices, result, case.structure, 1.0) - 1).max() < 0.1


@pytest.mark.xfail(
    strict=True, reason="nearest neighbours of sparse samples shrink a thin model by 3 % along its short side"
)
def test_sizes_have_no_bias(cases):
    case, sizes = cases["shelf"], []
    for seed in range(6):
        result = case.moved(case.fit(case.scan(case.vertices, seed=seed)))
        sizes.append(np.ptp(result, axis=0) / np.ptp(case.vertices, axis=0))
    assert np.abs(np.mean(sizes, axis=0) - 1).max() < 0.02


def rotated_back(case, degrees):
    """The chair whose back leans, and which vertices are the back's."""
    back = int(case.structure.boxes[:, 1, 1].argmax())
    mine, result, angle = case.structure.vertex_parts == back, case.vertices.copy(), np.radians(degrees)
    pivot = np.array([0.0, case.vertices[mine, 1].min(), case.vertices[mine, 2].mean()])
    turn = np.array([[1, 0, 0], [0, np.cos(angle), np.sin(angle)], [0, -np.sin(angle), np.cos(angle)]])
    result[mine] = (result[mine] - pivot) @ turn.T + pivot
    return result, mine


@pytest.mark.parametrize("degrees", [15.0, 20.0])
def test_a_back_that_leans_is_followed_by_rotation(cases, degrees):
    case = cases["chair"]
    wanted, back = rotated_back(case, degrees)
    result = case.moved(case.fit(case.scan(wanted)))
    assert np.abs(result[back] - wanted[back]).max() < 0.025
    assert np.abs(case.vertices[back] - wanted[back]).max() > 0.06
    structure, found = case.structure, case.cleanliness(result)
    maps = fit_part_maps(case.vertices, result, structure.vertex_parts, structure.parts)
    extents = own_extents(case.vertices, structure.vertex_parts, structure.axes)
    assert measure_shears(maps, structure.axes, extents).max() < 0.01
    assert found.squareness_95 < 1e-3
    assert found.flatness < 1e-6


@pytest.mark.xfail(strict=True, reason="of leans below some 13 degrees most are not seen: the back is only moved")
def test_a_back_that_leans_little_is_followed(cases):
    case = cases["chair"]
    wanted, back = rotated_back(case, 8.0)
    result = case.moved(case.fit(case.scan(wanted)))
    assert np.abs(result[back] - wanted[back]).max() < 0.02


def test_an_upright_back_does_not_lean(cases):
    case = cases["chair"]
    for seed in range(4):
        found = case.cleanliness(case.moved(case.fit(case.scan(case.vertices, seed=seed))))
        assert found.axis_tilt_95 < 0.01


def test_legs_grow_while_the_seat_keeps_its_thickness(cases):
    case, up = cases["chair"], 0.15
    parts, wanted = case.structure.vertex_parts, case.vertices.copy()
    standing = case.model.basis.standing
    seat = int(case.structure.boxes[:, 1, 2].argmax())
    legs = standing[parts]
    bottom = case.vertices[:, 1].min()
    wanted[~legs | (case.vertices[:, 1] > bottom + 0.1), 1] += up
    found = case.fit(case.scan(wanted))
    result = case.moved(found)
    assert np.abs(result - wanted).max() < 0.02
    grown = np.ptp(wanted[legs], axis=0)[1] / np.ptp(case.vertices[legs], axis=0)[1]
    np.testing.assert_allclose(found.growth()[standing, 1], grown, rtol=0.05)
    assert grown > 1.3
    assert abs(found.growth()[seat, 1] - 1) < 0.1


@pytest.mark.parametrize("name", ["table", "splayed chair", "round table"])
def test_the_order_of_scanned_points_matters_no_more_than_another_sample(cases, name, rng):
    case = cases[name]
    goal = case.scan(stretched(case.vertices))
    start = stretched(case.points)
    one, other = (case.moved(case.fit(some, start=start)) for some in (goal, goal[rng.permutation(len(goal))]))
    assert np.sqrt(((one - other) ** 2).sum(axis=1).mean()) < 0.015


@pytest.mark.parametrize("name", ["chair", "shelf"])
def test_the_order_of_parts_does_not_matter(cases, of_mesh, name):
    """The same mesh with its faces and vertices in the reverse order."""
    case = cases[name]
    count = len(case.vertices)
    reverse = of_mesh(case.vertices[::-1], (count - 1 - case.faces[::-1]).astype(case.faces.dtype))
    goal, start = case.scan(stretched(case.vertices)), stretched(case.points)
    one = case.moved(case.fit(goal, start=start))
    other = reverse.moved(reverse.fit(goal, start=stretched(reverse.points)))[::-1]
    assert np.sqrt(((one - other) ** 2).sum(axis=1).mean()) < 0.015


@pytest.mark.parametrize("name", ALONG_AXES)
def test_more_rounds_do_not_raise_the_error(cases, name):
    case = cases[name]
    goal = case.scan(stretched(case.vertices))
    errors = [
        chamfer(goal, case.model.moved(case.fit(goal, config=StructureConfig(iterations=rounds))))
        for rounds in (1, 3, 6, 12, 24)
    ]
    assert all(after < 1.03 * before for before, after in zip(errors, errors[1:]))
    assert errors[-1] < 0.6 * errors[0]


@pytest.mark.parametrize("category", ["chair", "table", "cabinet"])
@pytest.mark.parametrize("number", range(4))
def test_generated_furniture_fitted_to_its_like_stays_clean(of_mesh, category, number):
    """Whatever the family: planar facets stay planar within a part, and the mesh stays symmetric."""
    families = list(FAMILIES[category])
    family = families[number * len(families) // 4]
    mesh, like = (assemble(furniture(category, family, seed)) for seed in (number, number + 100))
    case, other = of_mesh(mesh.vertices, mesh.faces), of_mesh(like.vertices, like.faces)
    goal = np.ascontiguousarray(other.points * SIZE, np.float32)
    found = case.fit(goal, start=case.points * SIZE)
    assert chamfer(goal, case.model.moved(found)) < chamfer(goal, case.points * SIZE)
    # Flush facets of two parts count as one, and parts may slide along each other.
    facets, face_parts = case.structure.facets, case.structure.vertex_parts[case.faces[:, 0]]
    apart = np.unique(facets * case.structure.parts + face_parts, return_inverse=True)[1].reshape(-1)
    structure = replace(case.structure, facets=np.where(facets < 0, -1, apart))
    cleanliness = measure_cleanliness(case.vertices, case.moved(found), case.faces, structure)
    assert cleanliness.flatness < 1e-3
    # Parts count as mirrored where their boxes are alike to 0.02.
    assert cleanliness.mirror is None or cleanliness.mirror < 0.01
    assert cleanliness.contact_gap < 0.01


def test_flush_boards_stay_flush(build):
    """Two cubes of one plan, one on the other, and a scan in which the upper one is wider."""
    case = build([box((1.0, 0.5, 0.6), (0, 0.25, 0), "lower"), box((1.0, 0.5, 0.6), (0, 0.75, 0), "upper")])
    wanted = case.vertices.copy()
    wanted[wanted[:, 1] > 0.01] *= [1.02, 1.0, 1.02]
    assert case.cleanliness(case.moved(case.fit(case.scan(wanted)))).flatness < 1e-4


@pytest.mark.parametrize("category", ["chair", "table", "cabinet"])
def test_decimated_meshes_stay_clean(real, category):
    case = real[category]
    found = case.cleanliness(case.moved(case.fit(case.scan(stretched(case.vertices)), start=stretched(case.points))))
    assert found.flatness < 1e-4
    assert found.axis_tilt < 3.0
    assert found.contact_gap < 0.005
    assert found.mirror is None or found.mirror < 0.005


def test_parts_without_a_sample_are_carried_along(cases):
    """The curved back of a chair, when no point of the surface samples lies on it."""
    case = cases["curved chair"]
    back = int(np.flatnonzero(case.structure.curved)[0])
    sampled = case.model.parts != back
    arrays = case.model.points[sampled], case.model.parts[sampled], case.model.normals[sampled]
    model = StructureModel.of(case.structure, *arrays, StructureConfig())
    goal = np.ascontiguousarray(stretched(arrays[0]), dtype=np.float32)
    found = fit_structure(
        model, stretched(arrays[0]), Evidence(goal, lambda places: np.ones(len(places))), StructureConfig()
    )
    assert np.abs(case.moved(found) - stretched(case.vertices)).max() < 0.1
