"""Proposals of a furnished room contain its objects, whole."""

import numpy as np

from kpred.detection.networks import bundled_detector
from kpred.detection.propose import pair_odds, prepare_room, propose_objects


def test_each_object_has_a_proposal_that_covers_it(furnished_room: tuple[np.ndarray, np.ndarray]) -> None:
    points, owner = furnished_room
    room = prepare_room(points)
    proposals = propose_objects(room, pair_odds(room, bundled_detector().pairs))
    segment = room.voxels.segment[room.grid.owner]
    for row in range(3):
        mine = owner == row
        best = 0.0
        for pieces in proposals:
            found = np.isin(segment, list(pieces))
            best = max(best, (found & mine).sum() / (found | mine).sum())
        assert best > 0.7


def test_an_empty_room_has_no_proposals(empty_room: np.ndarray) -> None:
    room = prepare_room(empty_room)
    assert propose_objects(room, np.zeros(0)) == []
