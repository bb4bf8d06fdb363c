"""The detector's networks: what they may and may not depend on, and their files."""

from pathlib import Path

import pytest
import torch

from kpred.detection.adjacency import PAIR_FEATURES
from kpred.detection.networks import CHANNELS, FACTS, Detector, bundled_detector
from kpred.errors import ModelError


def test_the_order_of_points_does_not_matter() -> None:
    network = bundled_detector().proposals
    points = torch.randn(2, 50, CHANNELS)
    points[:, :, 3] = (torch.arange(50) < 30).float()
    with torch.inference_mode():
        logits, quality = network(points, torch.zeros(2, FACTS))
        again, same = network(points.flip(1), torch.zeros(2, FACTS))
    torch.testing.assert_close(logits, again)
    torch.testing.assert_close(quality, same)
    assert logits.shape == (2, 4)


def test_a_detector_is_read_as_it_was_written(tmp_path: Path) -> None:
    torch.manual_seed(0)
    detector = Detector().eval()
    detector.save(tmp_path / "detector")
    loaded = Detector.load(tmp_path / "detector")
    features = torch.randn(5, PAIR_FEATURES)
    torch.testing.assert_close(loaded.pairs(features), detector.pairs(features), atol=1e-2, rtol=1e-2)


def test_a_damaged_detector_is_refused(tmp_path: Path) -> None:
    Detector().save(tmp_path)
    weights = tmp_path / "model.safetensors"
    weights.write_bytes(weights.read_bytes()[:2000])
    with pytest.raises(ModelError, match="copy it again"):
        Detector.load(tmp_path)
