"""The quick way to the up axis says what the long way says."""

import numpy as np
import pytest
import torch

from kpred.nn import load_model
from kpred.ops import depth_scan
from kpred.ops.rotations import UP_AXES, upright_rotation, yaw_rotation
from kpred.pose.proposals import EVIDENCE_WEIGHT, MAX_AXES, up_axis
from kpred.pose.recognition import POINTS, predict_logits
from kpred.pose.up_axis import PRIOR, up_scores
from kpred.synthetic.generator import generate


@pytest.fixture(scope="module")
def scans() -> list[np.ndarray]:
    """Depth scans of furniture, with z up or y up."""
    found = []
    for number, category in enumerate(["chair", "table", "cabinet"]):
        for row, mesh in enumerate(generate(category, 2, seed=31)):
            vertices, faces = torch.from_numpy(mesh.vertices).float(), torch.from_numpy(mesh.faces).long()
            camera = torch.tensor([2.0 - row, 1.5, 3.0])
            chance = torch.Generator().manual_seed(10 * number + row)
            points = depth_scan(vertices, faces, camera, 2048, generator=chance).double().numpy()
            found.append(points @ upright_rotation("zy"[row]))
    return found


def test_a_glance_and_a_close_look_choose_what_all_points_and_turns_choose(scans: list[np.ndarray]) -> None:
    recognizer = load_model().recognizer
    assert recognizer is not None
    yaws = [yaw_rotation(yaw) for yaw in np.radians(np.arange(0, 360, 30))]
    for points in scans:
        scores = up_scores(points)
        total = {}
        for name in sorted(scores, key=lambda name: -scores[name])[:MAX_AXES]:
            odds, _ = predict_logits(points[:POINTS], [yaw @ upright_rotation(name) for yaw in yaws], recognizer)
            total[name] = PRIOR[name] + EVIDENCE_WEIGHT * (scores[name] - PRIOR[name]) + float(odds.max())
        assert up_axis(points, "auto", recognizer) == max(total, key=lambda name: total[name])


def test_shared_normals_change_no_score(scans: list[np.ndarray]) -> None:
    for points in scans[:3]:
        shared = up_scores(points)
        each = {}
        for name in UP_AXES:
            each |= up_scores(points, [name])
        assert shared == each
