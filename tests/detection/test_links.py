"""How pieces hang together: affinities follow the odds, weighed by contact."""

import numpy as np
import pytest

from kpred.detection.links import Links

PAIRS = np.array([[0, 1], [1, 2], [2, 3]])


def links(odds: list[float]) -> Links:
    contact = np.zeros((3, 5))
    contact[:, 0] = np.log1p([4.0, 1.0, 2.0])
    return Links(5, PAIRS, np.array(odds), contact)


def test_affinity_is_that_to_the_set() -> None:
    affinity, touched = links([6.0, -6.0, 6.0]).affinity({0, 1})
    assert affinity[0] == affinity[1] > 0.9  # To the other member.
    assert affinity[2] < -0.9
    assert affinity[3] == affinity[4] == 0.0
    np.testing.assert_allclose(touched, [4.0, 4.0, 1.0, 0.0, 0.0])


def test_larger_contacts_weigh_more() -> None:
    affinity, _ = links([3.0, -3.0, 0.0]).affinity({0, 2})
    assert 0.0 < affinity[1] < np.tanh(1.0)


def test_a_room_without_pairs_has_no_affinity() -> None:
    affinity, touched = Links(2, np.zeros((0, 2), np.int64), np.zeros(0), np.zeros((0, 5))).affinity({0})
    assert affinity.tolist() == touched.tolist() == [0.0, 0.0]


@pytest.mark.parametrize("odds", [-40.0, 40.0])
def test_affinities_are_bounded(odds: float) -> None:
    affinity, _ = links([odds, odds, odds]).affinity({1})
    assert np.abs(affinity).max() <= 1.0
