"""Scores: samples of one surface differ by their spacing alone, and the shape itself beats any other."""

import dataclasses

import numpy as np
import pytest

from kpred.refinement.score import NOISE, Distances, distances, spacing


def compare(goal, result, visible=None, step=1):
    goal, result = (np.ascontiguousarray(cloud, np.float32) for cloud in (goal, result))
    seen = np.ones(len(result)) if visible is None else visible
    return distances(goal, (spacing(goal), spacing(result)), result, seen, step)


@pytest.mark.parametrize("step", [1, 4])
def test_two_samples_of_a_surface_differ_by_their_spacing(case, step):
    found = compare(case.scan(case.vertices), case.points, step=step)
    assert abs(found.error - found.floor) < 0.25 * found.floor
    assert abs(found.log_error() - np.log(NOISE**2 + 0.15 * found.floor)) < 0.5


def test_the_noise_of_a_scan_shows(case, rng):
    clean = case.scan(case.vertices)
    noisy = clean + rng.normal(0, 0.03, clean.shape).astype(np.float32)
    assert compare(noisy, case.points).log_error() > compare(clean, case.points).log_error() + 0.5


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("factor", [0.85, 1.15])
def test_the_shape_itself_beats_a_stretched_one(case, axis, factor):
    size = np.ones(3)
    size[axis] = factor
    goal = case.scan(case.vertices)
    assert compare(goal, case.points).log_error() < compare(goal, case.points * size).log_error()


def test_the_shape_itself_beats_all_others(cases):
    for name, case in cases.items():
        goal = case.scan(case.vertices)
        scores = {other: compare(goal, cases[other].points).log_error() for other in cases}
        assert min(scores, key=lambda key: scores[key]) == name


def test_unseen_surface_is_free(cases):
    """Half of a table: what was not seen costs nothing, unless it is said to be seen."""
    case = cases["table"]
    goal = case.scan(case.vertices)
    half = goal[goal[:, 0] > 0]
    seen = (case.points[:, 0] > 0).astype(float)
    assert compare(half, case.points, seen).log_error() < compare(half, case.points).log_error() - 1
    none = compare(half, case.points, np.zeros(len(seen)))
    assert none.back == 0 and none.seen == 0 and np.isfinite(none.log_error())


def test_unseen_surface_in_an_unexpected_place_costs(case):
    found = compare(case.scan(case.vertices), case.points)
    assert dataclasses.replace(found, unseen=0.01).log_error() > found.log_error() + 1


def test_errors_below_the_noise_are_equal():
    def measured(error, floor):
        return Distances(forth=error, back=0.0, bounded=error, floor=floor, seen=1.0).log_error()

    assert measured(0.0, 0.0) == pytest.approx(2 * np.log(NOISE))
    assert measured(1e-5, 4e-4) == measured(3e-4, 4e-4) < measured(5e-4, 4e-4)


def test_how_far_a_stray_is_does_not_matter(case):
    goal = case.scan(case.vertices)
    near, far = (compare(np.vstack([goal, [[0.0, 0.0, distance]]]), case.points) for distance in (2.0, 20.0))
    assert far.error > near.error
    assert far.log_error() == pytest.approx(near.log_error(), abs=1e-3)


def test_spacing_falls_with_the_number_of_samples(case):
    few, many = (spacing(case.scan(case.vertices, count)) for count in (512, 2048))
    assert 2.5 < few / many < 6.5


@pytest.mark.parametrize("count", [0, 1, 3])
def test_too_few_points_have_no_spacing(count):
    assert spacing(np.zeros((count, 3), np.float32)) == 0
