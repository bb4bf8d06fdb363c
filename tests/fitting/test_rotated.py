"""A fit in a rotated frame of its scan is the same fit there."""

import numpy as np

import kpred
from kpred.fitting.defaults import sample_scan
from kpred.ops.frames import Frame
from kpred.pose.tilt import tilt_rotation


def test_all_of_a_fit_rotates_with_the_scan() -> None:
    found, rotation = kpred.fit(sample_scan(), up="y"), tilt_rotation(0.5)
    there = found.rotated(rotation)
    vertices = np.asarray(found.mesh.vertices)
    np.testing.assert_allclose(there.mesh.vertices, vertices @ rotation.T, atol=1e-9)
    np.testing.assert_allclose(there.keypoints, found.keypoints @ rotation.T, atol=1e-9)
    np.testing.assert_allclose(there.candidate(1).vertices, found.candidate(1).vertices @ rotation.T, atol=1e-9)
    np.testing.assert_allclose(there.retrieved_mesh.vertices, found.retrieved_mesh.vertices @ rotation.T, atol=1e-9)
    np.testing.assert_allclose(there.frame.to_unit(vertices @ rotation.T), found.frame.to_unit(vertices), atol=1e-9)
    assert isinstance(there.frame, Frame)
    moved = there.placement
    entry = found.placed.entry
    model = np.asarray(entry.mesh.vertices, dtype=np.float64)
    placed = model @ moved.matrix[:3, :3].T + moved.matrix[:3, 3]
    np.testing.assert_allclose(placed, there.retrieved_mesh.vertices, atol=1e-9)
    np.testing.assert_allclose(moved.rotation * moved.scale, moved.matrix[:3, :3], atol=1e-9)
    assert there.cleanliness.axis_tilt < found.cleanliness.axis_tilt + 0.01
