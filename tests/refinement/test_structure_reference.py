"""The compiled rounds agree with the plain ones, matches included."""

from itertools import product

import numpy as np
import pytest
from structure_reference import fit_rounds_reference, match_reference

from kpred.refinement import structure_fit
from kpred.refinement.matching_cpu import match, seen_points
from kpred.refinement.structure_config import StructureConfig

TOLERANCE = 1e-4


def _half_seen(places):
    return np.clip(3 * places[:, 2] + 0.6, 0, 1)


def _scan(case, seed=1):
    """The model stretched, sheared and moved, so that no unknown is idle."""
    vertices = case.vertices * [1.2, 0.9, 0.8] + [0.02, -0.03, 0.01]
    vertices[:, 2] -= 0.15 * np.maximum(case.vertices[:, 1], 0)
    return case.scan(vertices, seed=seed)


@pytest.mark.parametrize("rounds", [1, 3, 12])
@pytest.mark.parametrize("floor", [None, -0.45])
def test_the_compiled_fit_is_the_plain_one(case, rounds, floor, monkeypatch):
    """For two scans of three at least: of neighbours equally near in float32, either may be matched."""
    config, equal = StructureConfig(iterations=rounds, points=512), []
    for goal in (_scan(case, seed) for seed in (1, 2, 3)):
        compiled = case.fit(goal, _half_seen, floor, config)
        with monkeypatch.context() as patch:
            patch.setattr(structure_fit, "fit_rounds", fit_rounds_reference)
            plain = case.fit(goal, _half_seen, floor, config)
        assert np.abs(case.moved(compiled) - case.vertices).max() > 0.015
        off = np.abs(case.moved(compiled) - case.moved(plain)).max()
        assert off < 0.01
        equal.append(max(off, np.abs(case.model.moved(compiled) - case.model.moved(plain)).max()) < TOLERANCE)
    assert sum(equal) >= 2


def test_matches_are_those_of_all_pairs(cases, rng):
    case = cases["chair"]
    moved = case.points[:700].astype(np.float32)
    goal = _scan(case)[:600]
    facing = np.abs(case.model.normals[:700]).argmax(axis=1)
    assert len(set(facing)) == 3
    for visible, first, robust, sharp in product(
        (rng.random(700).astype(np.float32), np.zeros(700, np.float32)), (0, 1), (0.0, 400.0), (False, True)
    ):
        wanted = np.empty((700, 4), np.float32)
        match(moved, facing, sharp, goal, visible, seen_points(visible), first, robust, 1e-4, wanted)
        places, weights = match_reference(moved, goal, visible, first, robust, 1e-4, facing if sharp else None)
        np.testing.assert_allclose(wanted[:, 3], weights, atol=1e-6)
        np.testing.assert_allclose(wanted[:, :3], places, atol=1e-6)
