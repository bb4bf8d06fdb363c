"""Readings of a scan by a recognizer whose answers are known: it finds the yaw, and orders readings by their odds."""

import math

import numpy as np
import pytest
import torch

from kpred.errors import ConfigError
from kpred.nn import Recognizer, RecognizerConfig
from kpred.ops.rotations import upright_rotation, yaw_rotation
from kpred.pose.proposals import generate_poses, score_poses, up_axis
from kpred.pose.recognition import recognize_poses, select_odds


class Oracle(Recognizer):
    """Knows that a chair's mark, its highest point, lies at the back (-z); everything else about it is right."""

    def __init__(self) -> None:
        super().__init__(RecognizerConfig(("chair", "table"), width=8, blocks=0))

    def forward(self, points: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        mark = torch.stack([cloud[cloud[:, 1].argmax()] for cloud in points])
        off = torch.atan2(-mark[:, 0], -mark[:, 2])
        chair = 6.0 - 12.0 * off.abs()
        answers = torch.stack([chair, chair - 3.0, torch.zeros_like(chair)], dim=1)
        return answers, (-off).clamp(-0.5, 0.5)


@pytest.fixture
def scan(rng: np.random.Generator) -> np.ndarray:
    """A flat round cloud without any edge that tells its yaw, and one high point at the back.

    Points come in opposite pairs: the first few of them have their mean where all have it.
    """
    angle, radius = rng.uniform(0, 2 * np.pi, 250), np.sqrt(rng.uniform(0, 1, 250))
    flat = np.stack([radius * np.cos(angle), 0.02 * rng.standard_normal(250), radius * np.sin(angle)], axis=1)
    return np.concatenate([[[0.0, 1.0, -1.0]], np.stack([flat, -flat], axis=1).reshape(-1, 3)])


@pytest.mark.parametrize("degrees", [0.0, 17.0, -100.0, 163.0])
@pytest.mark.parametrize("up", ["y", "z"])
def test_the_yaw_is_found_wherever_the_scan_faces(scan: np.ndarray, degrees: float, up: str) -> None:
    stands = scan @ yaw_rotation(math.radians(degrees)).T
    placed = stands @ upright_rotation(up) * 300.0 + np.array([10.0, 2000.0, -7.0])
    # The oracle looks at places about the origin of a cloud that is centred on its mean.
    found = recognize_poses(placed, upright_rotation(up), Oracle(), ("chair", "table"))
    assert (found[0].category, found[0].log_odds > 0) == ("chair", True)
    standing = (placed - placed.mean(axis=0)) @ found[0].rotation.T
    mark = standing[0]
    assert abs(math.degrees(math.atan2(-mark[0], -mark[2]))) < 2.0


def test_readings_come_by_falling_odds_and_only_of_the_asked_categories(scan: np.ndarray) -> None:
    found = recognize_poses(scan, np.eye(3), Oracle(), ("table",))
    assert {hypothesis.category for hypothesis in found} == {"table"}
    odds = [hypothesis.log_odds for hypothesis in found]
    assert odds == sorted(odds, reverse=True) and len(found) > 1


def test_categories_that_nobody_asked_for_count_as_none_unless_the_category_is_given() -> None:
    recognizer = Recognizer(RecognizerConfig(("chair", "sofa", "table"), width=8, blocks=0))
    odds = np.array([[1.0, 6.0, -2.0]])
    assert np.allclose(select_odds(odds, recognizer, ("chair", "table", "sofa")), [[1.0, -2.0, 6.0]])
    against_sofa = select_odds(odds, recognizer, ("chair", "table"))
    assert np.allclose(against_sofa, np.array([[1.0, -2.0]]) - np.log(1 + np.exp(6.0)))
    assert np.allclose(select_odds(odds, recognizer, ("chair",)), [[1.0]])


def test_given_rotations_are_kept_and_judged(scan: np.ndarray) -> None:
    yaws = [yaw_rotation(angle) for angle in (0.0, 2.0)]
    found = score_poses(scan, yaws, Oracle(), ("chair",))
    assert np.array_equal(found[0].rotation, yaws[0]) and found[0].log_odds > found[1].log_odds


def test_a_category_that_the_recognizer_does_not_know_is_not_judged(scan: np.ndarray) -> None:
    found = generate_poses(scan, "y", None, Oracle(), ("chair", "lamp"))
    assert {hypothesis.category for hypothesis in found} == {"chair", "lamp"}
    assert found[0].log_odds == 0.0, "nothing judged it"


def test_an_up_axis_that_is_none_is_refused(scan: np.ndarray) -> None:
    with pytest.raises(ConfigError, match="sideways"):
        up_axis(scan, "sideways", Oracle())
    assert up_axis(scan, "z", Oracle()) == "z"
