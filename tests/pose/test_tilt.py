"""Tilt of a camera without a pose: found in most views, and level cameras stay level."""

import numpy as np
import pytest
import torch

from kpred.fitting.defaults import resolve_model
from kpred.ops.occlusion import depth_scan
from kpred.pose.tilt import find_tilt, tilt_rotation
from kpred.shapes.mesh import Mesh
from kpred.synthetic.generator import generate


def view(mesh: Mesh, tilt: float, seed: int) -> np.ndarray:
    """Points (N, 3) that a camera which looks down by `tilt` (radians) sees, in its axes."""
    size = float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))
    yaw = np.random.default_rng(seed).uniform(-1.0, 1.0)
    away = np.array([np.sin(yaw) * np.cos(tilt), np.sin(tilt), np.cos(yaw) * np.cos(tilt)])
    camera = mesh.bounds.mean(axis=0) + 2.2 * size * away
    seen = depth_scan(
        torch.tensor(mesh.vertices).float(),
        torch.tensor(mesh.faces).long(),
        torch.tensor(camera).float(),
        2000,
        resolution=110,
        noise=0.004,
        generator=torch.Generator().manual_seed(seed),
    )
    right = np.array([np.cos(yaw), 0.0, -np.sin(yaw)])
    down = np.cross(-away, right)
    return (seen.double().numpy() - camera) @ np.stack([right, down, -away]).T


def test_level_axes_have_down_along_y() -> None:
    tilt = 0.4
    down = np.array([0.0, np.cos(tilt), np.sin(tilt)])  # in the axes of the camera
    np.testing.assert_allclose(tilt_rotation(tilt) @ down, [0.0, 1.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(tilt_rotation(0.0), np.eye(3))


@pytest.mark.parametrize(("degrees", "allowed"), [(0.0, 5.0), (25.0, 3.0), (45.0, 3.0)])
def test_the_tilt_of_most_views_is_found(degrees: float, allowed: float) -> None:
    recognizer = resolve_model(None).recognizer
    assert recognizer is not None
    errors = []
    for category in ("chair", "table", "cabinet"):
        for seed, mesh in enumerate(generate(category, 4, seed=51, splits=False)):
            points = view(mesh, np.radians(max(degrees, 3.0)), seed)
            errors.append(abs(np.degrees(find_tilt(points, recognizer)) - degrees))
    assert np.mean(np.array(errors) <= allowed) >= 0.8
    assert np.median(errors) <= 1.0
