"""The best proposals are kept; other readings of the same object are not."""

import numpy as np
import pytest

from kpred.detection.networks import bundled_detector
from kpred.detection.propose import PreparedRoom, pair_odds, prepare_room, propose_objects
from kpred.detection.selection import select_proposals


@pytest.fixture(scope="module")
def prepared(furnished_room: tuple[np.ndarray, np.ndarray]) -> PreparedRoom:
    return prepare_room(furnished_room[0])


def test_no_piece_is_in_two_objects(prepared: PreparedRoom) -> None:
    proposals = sorted(propose_objects(prepared, pair_odds(prepared, bundled_detector().pairs)), key=sorted)
    scores = np.random.default_rng(0).random(len(proposals))
    chosen = select_proposals(prepared, proposals, scores, 0.1)
    pieces = [piece for _, members in chosen for piece in members]
    assert len(pieces) == len(set(pieces)) > 0
    assert chosen[0] == (int(scores.argmax()), proposals[int(scores.argmax())])


def test_what_scores_too_low_is_left_out(prepared: PreparedRoom) -> None:
    proposals = [frozenset({0}), frozenset({1})]
    chosen = select_proposals(prepared, proposals, np.array([0.05, 0.6]), 0.1)
    assert [row for row, _ in chosen] == [1]


def test_a_second_reading_of_an_object_is_left_out(prepared: PreparedRoom) -> None:
    assert prepared.pieces is not None
    large = int(prepared.pieces.sizes.argmax())
    other = (large + 1) % len(prepared.pieces.sizes)
    proposals = [frozenset({large}), frozenset({large, other})]
    chosen = select_proposals(prepared, proposals, np.array([0.6, 0.5]), 0.1)
    assert [row for row, _ in chosen] == [0]
