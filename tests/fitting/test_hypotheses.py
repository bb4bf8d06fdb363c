"""Hypotheses of a scan: the best one is read with all points, however many others it was compared with."""

import math

import numpy as np
import pytest
import torch

from kpred.errors import ConfigError
from kpred.fitting.defaults import resolve_database, resolve_model
from kpred.fitting.hypotheses import Search, hypotheses
from kpred.fitting.stages import MAX_READINGS, ODDS_RANGE, worth_trying
from kpred.ops import sample_surface
from kpred.pose.proposals import check_known_frame, generate_poses
from kpred.pose.recognition import PoseHypothesis
from kpred.synthetic.generator import generate


@pytest.fixture(scope="module")
def search() -> Search:
    return Search(resolve_model(None), resolve_database(None), top_k=3, retrieved=3, frame_known=False)


@pytest.fixture(scope="module")
def points() -> np.ndarray:
    mesh = generate("chair", 1, seed=5)[0]
    vertices, faces = torch.from_numpy(mesh.vertices).float(), torch.from_numpy(mesh.faces).long()
    return sample_surface(vertices, faces, 2048, torch.Generator().manual_seed(0))[0].double().numpy()


@pytest.mark.parametrize("partial", [False, True])
def test_the_best_of_several_readings_is_read_as_if_it_were_alone(
    search: Search, points: np.ndarray, partial: bool
) -> None:
    readings = generate_poses(points, "y", None, search.model.recognizer, search.model.categories)[:3]
    found = hypotheses(points, readings, search, partial)
    assert found[0].category == "chair"
    assert [one.score for one in found] == sorted((one.score for one in found), reverse=True)
    matching = [one for one in readings if np.allclose(one.rotation, found[0].frame.rotation)]
    (chosen,) = [one for one in matching if one.category == found[0].category]
    (alone,) = hypotheses(points, [chosen], search, partial)
    assert alone.candidates.model_ids == found[0].candidates.model_ids
    np.testing.assert_array_equal(alone.frame.matrix(), found[0].frame.matrix())
    torch.testing.assert_close(alone.candidates.displacement, found[0].candidates.displacement, rtol=0, atol=1e-5)


def test_readings_that_are_far_less_likely_than_the_best_are_not_tried() -> None:
    odds = [3.0, 2.0, 3.0 - ODDS_RANGE + 0.1, 3.0 - ODDS_RANGE - 0.1, -9.0]
    readings = [PoseHypothesis(np.eye(3), "chair", value) for value in odds]
    assert [one.log_odds for one in worth_trying(readings, are_scored=True)] == odds[:3]
    assert worth_trying(readings, are_scored=False) == readings
    alike = [PoseHypothesis(np.eye(3), "chair", -0.01 * row) for row in range(20)]
    assert worth_trying(alike, are_scored=True) == alike[:MAX_READINGS]


def test_a_known_frame_holds_the_scan() -> None:
    check_known_frame(np.array([[1.0, -1.0, 0.0], [math.nextafter(1.5, 0), 0.0, 0.0]]))
    with pytest.raises(ConfigError, match="known"):
        check_known_frame(np.array([[1.6, 0.0, 0.0]]))
