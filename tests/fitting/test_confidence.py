"""Confidence: what must raise it and what must lower it, turns that change nothing, and what people are told."""

import dataclasses
import math

import numpy as np
import pytest
import torch
import trimesh

from kpred.fitting.candidates import Candidates
from kpred.fitting.confidence import Evidence, category_probabilities, confidence, evidence_of
from kpred.fitting.explanation import Explanation
from kpred.fitting.hypotheses import Hypothesis
from kpred.fitting.warnings import floor_gap, warnings_of
from kpred.ops.frames import Frame
from kpred.ops.rotations import yaw_rotation
from kpred.preprocessing.clean import CleaningStep
from kpred.refinement.placement import Placement
from kpred.refinement.score import Distances, Step
from kpred.refinement.structure_basis import structure_basis
from kpred.refinement.structure_config import StructureConfig
from kpred.refinement.structure_fit import StructureMap
from kpred.shapes.structure.analyse import find_structure

GOOD = Evidence(error=0.03, unexplained=0.0, seen=0.9, category=0.99, turn=0.99, odds=5.0, box=0.05)


@pytest.mark.parametrize("odds", [5.0, None])
@pytest.mark.parametrize(
    "worse", [{"error": 0.2}, {"unexplained": 0.4}, {"category": 0.4}, {"turn": 0.4}, {"odds": -6.0}], ids=str
)
def test_what_speaks_against_a_result_lowers_its_confidence(odds: float | None, worse: dict[str, float]) -> None:
    good = dataclasses.replace(GOOD, odds=odds)
    if odds is None and "odds" in worse:
        worse = {"seen": 0.1}
    assert 0.0 < confidence(dataclasses.replace(good, **worse)) < confidence(good) < 1.0


def test_a_good_fit_is_trusted_and_a_bad_one_is_not() -> None:
    assert confidence(GOOD) > 0.8
    assert confidence(Evidence(0.25, 0.5, 0.2, 0.4, 0.4, -8.0, 0.5)) < 0.1


@pytest.mark.parametrize("odds", [8.0, None])
def test_confidence_falls_with_what_stays_unexplained(odds: float | None) -> None:
    best = Evidence(error=0.01, unexplained=0.0, seen=1.0, category=1.0, turn=1.0, odds=odds, box=0.01)
    found = [confidence(dataclasses.replace(best, unexplained=part)) for part in np.arange(0.0, 0.5, 0.02)]
    assert (np.diff(found) < 0).all()
    assert confidence(dataclasses.replace(best, unexplained=0.1)) > 0.9 * found[0]
    assert confidence(dataclasses.replace(best, unexplained=0.2)) < 0.75 * found[0]
    assert confidence(dataclasses.replace(best, unexplained=0.26)) < 0.5
    assert confidence(dataclasses.replace(best, unexplained=0.44)) < 0.05


def _reading(cloud: torch.Tensor, degrees: float, score: float, category: str = "chair") -> Hypothesis:
    """One candidate that is the cloud itself, its scan the same cloud."""
    none = torch.zeros(1, 1, 3)
    candidates = Candidates(
        ("a",), category, np.zeros(1), cloud[None], torch.zeros(1, len(cloud), 1), none, cloud, torch.ones(1), True
    )
    frame = Frame(np.zeros(3), 1.0, yaw_rotation(math.radians(degrees)))
    return Hypothesis(candidates, frame, 1e-3, score)


@pytest.fixture
def square_and_bar(rng: np.random.Generator) -> tuple[torch.Tensor, torch.Tensor]:
    """A square plate, which a quarter turn leaves as it is, and a bar, which only half a turn does."""
    points = torch.from_numpy(rng.uniform(-1, 1, (2048, 3))).float()
    return points * torch.tensor([1.0, 0.1, 1.0]), points * torch.tensor([1.0, 0.1, 0.2])


def test_turns_that_change_nothing_are_no_doubt(square_and_bar: tuple[torch.Tensor, torch.Tensor]) -> None:
    for cloud, quarter, half in zip(square_and_bar, (1.0, 0.5), (1.0, 1.0), strict=True):
        for degrees, expected in ((90.0, quarter), (180.0, half), (5.0, 1.0)):
            tried = [_reading(cloud, 0.0, 2.0), _reading(cloud, degrees, 2.0)]
            assert evidence_of(tried[0], cloud, cloud, tried, True).turn == pytest.approx(expected)


def test_a_category_has_the_odds_of_its_best_reading(square_and_bar: tuple[torch.Tensor, torch.Tensor]) -> None:
    cloud = square_and_bar[0]
    tried = [_reading(cloud, 0, 3.0), _reading(cloud, 90, 2.9), _reading(cloud, 0, 1.0, "table")]
    found = category_probabilities(tried)
    assert list(found) == ["chair", "table"] and sum(found.values()) == pytest.approx(1.0)
    assert category_probabilities(tried[:1]) == {"chair": 1.0}
    assert found["chair"] == category_probabilities([tried[0], tried[2]])["chair"]


def test_what_a_model_was_changed_by_is_measured(square_and_bar: tuple[torch.Tensor, torch.Tensor]) -> None:
    cloud = square_and_bar[0]
    tried = [_reading(cloud, 0.0, 2.0)]
    moved = cloud + torch.tensor([0.3, 0.0, 0.4])
    assert evidence_of(tried[0], cloud, cloud, tried, True).change == 0
    assert evidence_of(tried[0], moved, cloud, tried, True).change == pytest.approx(0.5, abs=1e-6)
    assert evidence_of(tried[0], cloud, moved, tried, True).error == 0


def test_people_are_told_what_to_look_at() -> None:
    fine = warnings_of(GOOD, 0.97, "chair", {"chair": 0.99, "table": 0.01}, (), 2000)
    assert fine == ()
    doubtful = dataclasses.replace(GOOD, category=0.6, turn=0.5, unexplained=0.3, odds=-3.0)
    steps = (CleaningStep("outliers", 1500, ""), CleaningStep("density", 400, ""))
    found = warnings_of(doubtful, 0.2, "chair", {"chair": 0.6, "table": 0.4}, steps, 2000)
    assert len(found) == 5
    for words in ("no chair or table", "a table as well", "another way", "30 %", "75 %"):
        assert any(words in sentence for sentence in found), words


def _explanation(step: Step, growth: float | None = None) -> Explanation:
    """An explanation by this step; with a growth, of one cuboid that grows by it along x."""
    points = np.zeros((4, 3), np.float32)
    structure = None if growth is None else _grown(growth)
    distances = Distances(forth=0.0, back=0.0, bounded=0.0, floor=0.0, seen=1.0)
    return Explanation(step, lambda model: model.points, points, distances, 0.0, Placement.identity(), structure)


def _grown(growth: float) -> StructureMap:
    box = trimesh.creation.box((1.0, 2.0, 1.0))
    vertices, faces = np.asarray(box.vertices), np.asarray(box.faces)
    structure = find_structure(vertices, faces, vertices[faces].mean(axis=1), np.arange(len(faces)))
    basis = structure_basis(structure, StructureConfig())
    solution = np.zeros((3, basis.unknowns))
    # A part's own growth is its second unknown.
    solution[0, basis.controls + 1] = (growth - 1.0) * basis.half[0, 0]
    found = StructureMap(basis, solution)
    np.testing.assert_allclose(found.growth(), [[growth, 1.0, 1.0]])
    return found


@pytest.mark.parametrize(
    ("step", "growth", "words"),
    [
        ("none", None, None),
        ("scale", None, None),
        ("structure", 1.0, None),
        ("structure", 2.4, None),
        ("structure", 0.45, None),
        ("structure", 2.6, "grew to 2.6 times"),
        ("structure", 0.35, "shrank to 0.35 times"),
        ("free", None, "bent"),
        ("paper", None, "bent"),
    ],
)
def test_people_are_told_what_was_done_to_the_model(step: Step, growth: float | None, words: str | None) -> None:
    found = warnings_of(GOOD, 0.97, "chair", {"chair": 1.0}, (), 2000, _explanation(step, growth))
    assert len(found) == (words is not None)
    assert words is None or words in found[0]


@pytest.mark.parametrize(
    ("floor", "words"), [(0.01, None), (-0.03, None), (-0.2, "10 % of its size above"), (None, None)]
)
def test_people_are_told_of_feet_off_the_floor(floor: float | None, words: str | None) -> None:
    table = np.array([[0.0, 0.0, 0.0], [2.0, 1.0, 1.0]])
    found = warnings_of(GOOD, 0.97, "table", {"table": 1.0}, (), 2000, floor_gap=floor_gap(table, floor))
    assert len(found) == (words is not None)
    assert words is None or words in found[0]
    if floor is not None:
        assert floor_gap(table * 100, floor * 100) == pytest.approx(floor_gap(table, floor))
