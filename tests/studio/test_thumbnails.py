"""Thumbnails: one for each candidate, numbered, the chosen one framed."""

import numpy as np

from kpred.studio.state import State
from kpred.studio.thumbnails import COLUMNS, SIDE, candidate_thumbnails, thumbnail_sheet


def test_every_candidate_has_a_picture_and_the_chosen_one_a_frame(start: State) -> None:
    found = candidate_thumbnails(start.searched)
    assert len(found) == len(start.candidates)
    assert all(picture.shape == (SIDE, SIDE, 3) and picture.min() < 128 for picture in found)
    plain, framed = thumbnail_sheet(found, None), thumbnail_sheet(found, COLUMNS)
    changed = np.argwhere((plain != framed).any(axis=2))
    # The first of the second row.
    assert changed[:, 0].min() >= SIDE and changed[:, 1].max() < SIDE
