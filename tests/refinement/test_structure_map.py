"""Whatever the unknowns are, as long as the fit allows them: planes, right angles and orientation stay."""

import numpy as np
import pytest

from kpred.refinement.freedom import growth_limits, possible_bends, possible_leans, spline_slopes, spline_spans
from kpred.refinement.structure_basis import KINDS
from kpred.refinement.structure_cpu import bound_growth
from kpred.refinement.structure_fit import StructureMap
from kpred.shapes.structure.cleanliness import thickness_ratios
from kpred.synthetic.parts import box, curved_panel, cylinder

MOVE, GROW, LEAN, BEND = range(KINDS)


def random_map(case, rng, lean=0.03, bend=0.0):
    """Unknowns that the fit could end with: monotone splines, and growth, leans and bends within their limits."""
    basis = case.model.basis
    controls, slopes = basis.controls, spline_slopes(basis)
    solution = rng.normal(0, 0.2, (3, basis.unknowns))
    steps = rng.uniform(slopes[:, :1], np.minimum(slopes[:, 1:2], 0.2), (3, controls - 1))
    solution[:, 1:controls] = solution[:, :1] + np.cumsum(steps, axis=1)
    solution[:, controls + LEAN :: KINDS] *= lean / 0.2 * (possible_leans(basis).T > 0)
    solution[:, controls + BEND :: KINDS] *= bend / 0.2 * (possible_bends(basis, case.points, case.model.parts).T > 0)
    bound_growth(solution, basis.growth, growth_limits(basis), spline_spans(basis), slopes, basis.group, basis.controls)
    return StructureMap(basis, solution)


@pytest.mark.parametrize("seed", range(5))
def test_no_solution_bends_or_folds_anything(case, seed):
    result = case.moved(random_map(case, np.random.default_rng(seed)))
    assert np.abs(result - case.vertices).max() > 0.1
    found = case.cleanliness(result)
    assert found.flatness < 1e-6
    assert found.squareness_95 < 2e-3
    assert found.parallelism < 1e-3
    assert found.part_shear < 1e-3
    assert found.folded_faces == 0


@pytest.mark.parametrize("name", ["table", "chair", "shelf"])
@pytest.mark.parametrize("seed", range(3))
def test_cuboids_stay_along_the_axes_unless_they_lean(cases, name, seed):
    found = cases[name].cleanliness(cases[name].moved(random_map(cases[name], np.random.default_rng(seed), lean=0.0)))
    assert found.axis_tilt_95 < 1e-3
    assert found.squareness_95 < 1e-3


@pytest.mark.parametrize("seed", range(3))
def test_only_what_is_bent_bends(build, seed):
    """A back that is bowed on its way up, a straight round post, a seat."""
    back = curved_panel(0.5, 0.4, 0.03, -0.08, 0.0, (0.0, 0.0, 0.0), "back").rotated("z", 90.0).moved((0.0, 0.7, -0.2))
    post = cylinder(0.03, (0.0, 0.0, 0.0), (0.0, 0.4, 0.0), "post", sides=24)
    case = build([back, post, box((0.45, 0.05, 0.45), (0.0, 0.42, 0.0), "seat")])
    straight = random_map(case, np.random.default_rng(seed), lean=0.0)
    bent = random_map(case, np.random.default_rng(seed), lean=0.0, bend=0.05)
    off = np.abs(case.moved(straight) - case.moved(bent)).max(axis=1)
    mine = case.structure.vertex_parts == case.structure.vertex_parts[np.argmax(case.vertices[:, 1])]
    assert off[mine].max() > 1e-3
    assert off[~mine].max() == 0


def test_no_unknowns_are_the_identity(case):
    zero = StructureMap(case.model.basis, np.zeros((3, case.model.basis.unknowns)))
    np.testing.assert_allclose(case.moved(zero), case.vertices, atol=3e-7)
    np.testing.assert_allclose(zero.growth(), 1.0)


def test_growth_is_that_of_the_sides(cases):
    """Of parts along the axes that do not lean."""
    for name in ("table", "chair", "shelf"):
        case = cases[name]
        found = random_map(case, np.random.default_rng(0), lean=0.0)
        result, parts = case.moved(found), case.structure.vertex_parts
        for part in range(case.structure.parts):
            sides = np.ptp(result[parts == part], axis=0) / np.ptp(case.vertices[parts == part], axis=0)
            np.testing.assert_allclose(found.growth()[part], sides, rtol=1e-3)


@pytest.mark.parametrize("lean", [0.0, 0.03])
def test_a_point_goes_where_it_goes_alone(case, lean):
    """A map is a function of a point and its part, whatever other points are moved with it."""
    found = random_map(case, np.random.default_rng(1), lean=lean)
    together, parts = case.moved(found), case.structure.vertex_parts
    for part in range(case.structure.parts):
        one = np.flatnonzero(parts == part)[-1:]
        np.testing.assert_allclose(found(case.vertices[one], parts[one]), together[one], atol=1e-5)


def test_the_order_of_points_does_not_matter(case, rng):
    found = random_map(case, np.random.default_rng(2))
    order, parts = rng.permutation(len(case.vertices)), case.structure.vertex_parts
    np.testing.assert_allclose(found(case.vertices[order], parts[order]), case.moved(found)[order], atol=1e-5)


def test_mirrored_parts_lean_against_each_other_from_any_first_point(cases):
    case = cases["splayed chair"]
    found = random_map(case, np.random.default_rng(3), lean=0.1)
    basis, parts = case.model.basis, case.structure.vertex_parts
    for part in np.flatnonzero(basis.sign < 0):
        mine = case.vertices[parts == part]
        among = found(np.vstack([basis.middle[part], mine]), np.full(len(mine) + 1, part))[1:]
        np.testing.assert_allclose(among, found(mine, np.full(len(mine), part)), atol=1e-3)


def test_thin_boards_do_not_turn_inside_out(build):
    sides = [box((0.03, 1.4, 0.3), (x, 0.7, 0.0), "side") for x in (-0.385, 0.385)]
    case = build([*sides, box((0.74, 1.36, 0.01), (0.0, 0.7, -0.12), "back")])
    for seed in range(20):
        result = case.moved(random_map(case, np.random.default_rng(seed), lean=0.0))
        assert case.cleanliness(result).folded_faces == 0
        assert thickness_ratios(case.vertices, result, case.structure, 1.0).min() > 0.05
