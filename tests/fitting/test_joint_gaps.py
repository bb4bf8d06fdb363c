"""Results whose parts fell apart: the gap is measured, an unbroken candidate goes first, confidence falls."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from kpred.fitting.candidates import Candidates
from kpred.fitting.defaults import resolve_database
from kpred.fitting.explanation import Deformed, Explanation
from kpred.fitting.joint_gaps import MAX_GAP, WORSE, joint_factor, joint_gap, unbroken_first
from kpred.fitting.visibility import all_seen
from kpred.refinement.placement import Placement
from kpred.refinement.score import Distances
from kpred.refinement.structure_basis import KINDS
from kpred.refinement.structure_config import StructureConfig
from kpred.refinement.structure_fit import StructureMap, StructureModel
from kpred.shapes.structure import Structure

HIGHER = 0.2


@pytest.fixture(scope="module")
def candidates() -> Candidates:
    """Two tables of boxes along the axes, as they were retrieved."""
    database = resolve_database(None)
    names = [name for name in database.model_ids("table") if name.startswith(("dining", "writing_desk"))][:2]
    arrays = database.candidates("table", names)
    count = len(names)
    return Candidates(
        model_ids=tuple(names), category="table", distances=np.ones(count), points=torch.from_numpy(arrays.points),
        basis=torch.from_numpy(arrays.point_basis), displacement=torch.zeros(count, 12, 3),
        target=torch.from_numpy(arrays.points[0]), confidence=torch.ones(12), partial=False,
        structures=arrays.structures, point_parts=arrays.point_parts, point_normals=arrays.point_normals,
    )  # fmt: skip


def explained(candidates: Candidates, row: int, score: float, higher: float = 0.0) -> Explanation:
    """The model as it is, but for its largest part, which is moved up."""
    model: StructureModel = candidates.structure_model(row, StructureConfig())
    solution = np.zeros((3, model.basis.unknowns))
    largest = int(model.basis.half.prod(axis=1).argmax())
    solution[1, model.basis.controls + KINDS * int(model.basis.group[largest])] = higher
    found = StructureMap(model.basis, solution)
    distances = Distances(0.0, 0.0, 0.0, 0.0, 1.0)
    return Explanation(
        "structure", lambda points: found(points.points, points.parts), model.moved(found), distances, score,
        Placement.identity(), found,
    )  # fmt: skip


def test_what_is_not_deformed_has_no_gap(candidates: Candidates) -> None:
    assert joint_gap(explained(candidates, 0, 0.0)) < 1e-6
    assert joint_gap(replace(explained(candidates, 0, 0.0, HIGHER), structure=None)) == 0.0


def test_the_gap_is_as_wide_as_the_part_was_moved(candidates: Candidates) -> None:
    one = explained(candidates, 0, 0.0, HIGHER)
    structure: Structure = candidates.structures[0]
    assert len(structure.contact_points) > 0
    size = float(np.ptp(one.points, axis=0).max())
    # The legs may have reached into the top before.
    assert 0.5 * HIGHER < joint_gap(one) * size < 1.05 * HIGHER


@pytest.mark.parametrize(("worse", "first"), [(0.5 * WORSE, 1), (2.0 * WORSE, 0)])
def test_an_unbroken_candidate_goes_first_if_it_is_about_as_good(
    candidates: Candidates, worse: float, first: int
) -> None:
    broken, whole = explained(candidates, 0, -5.0, HIGHER), explained(candidates, 1, -5.0 + worse)
    assert joint_gap(broken) > MAX_GAP
    deformed = Deformed(candidates, all_seen(), (broken, whole), 1.0)
    assert unbroken_first(deformed, [0, 1]) == [first, 1 - first]
    assert unbroken_first(deformed, [1, 0]) == [1, 0]


def test_confidence_falls_with_the_gap() -> None:
    factors = [joint_factor(gap) for gap in (0.0, MAX_GAP, 0.04, 0.1)]
    assert factors[:2] == [1.0, 1.0]
    assert 1.0 > factors[2] > 0.8 > factors[3] > 0.0
