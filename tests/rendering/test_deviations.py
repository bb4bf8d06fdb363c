"""Deviations: distances to the surface, their colours and their sentence."""

import numpy as np
import pytest
import trimesh

from kpred.rendering.deviations import FAR, FAR_COLOR, MIDDLE_COLOR, MIN_SHOWN, NEAR_COLOR, Deviations, thinned


def test_distances_are_those_to_the_surface_and_colours_follow_them() -> None:
    box = trimesh.creation.box((2.0, 2.0, 2.0))
    offsets = np.array([0.0, FAR / 2, FAR, 5 * FAR])
    points = np.stack([np.zeros(4), 1.0 + offsets, np.zeros(4)], axis=1)
    found = Deviations.measure(points, np.asarray(box.vertices), np.asarray(box.faces))
    np.testing.assert_allclose(found.distances, offsets, atol=1e-12)
    np.testing.assert_array_equal(found.colors(), [NEAR_COLOR, MIDDLE_COLOR, FAR_COLOR, FAR_COLOR])


def test_the_sentence_is_in_centimetres() -> None:
    found = Deviations(np.zeros((100, 3)), np.full(100, 0.01))
    assert "0.45 cm on average, 95 % within 0.45 cm" in found.sentence(45.0)


@pytest.mark.parametrize("faces", [10, 10_000, 10_000_000])
def test_large_meshes_are_measured_at_fewer_points_but_never_few(faces: int) -> None:
    shown = thinned(np.zeros((200_000, 3)), faces)
    assert MIN_SHOWN / 2 < len(shown) <= 8000
