"""Small networks and clouds for the tests of the networks."""

from typing import Any

import pytest
import torch

from kpred.nn import KPRed, ModelConfig

SMALL: dict[str, Any] = {"width": 16, "token_size": 8, "region_points": 16, "keypoints": 12}


@pytest.fixture
def small():
    """Builds a small network from settings, with seeded weights; every weight that starts at zero is perturbed."""

    def build(seed: int = 0, trained: bool = True, **settings: Any) -> KPRed:
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            network = KPRed(ModelConfig(**{**SMALL, **settings}))
            if trained:
                for parameter in network.parameters():
                    parameter.data += 0.02 * torch.randn_like(parameter)
        return network.eval()

    return build


@pytest.fixture
def clouds(generator: torch.Generator) -> torch.Tensor:
    """Three clouds of 256 points in the unit box, of different proportions."""
    points = 2 * torch.rand(3, 256, 3, generator=generator) - 1
    return points * torch.tensor([[[1.0, 1, 1]], [[0.5, 1, 0.3]], [[1.0, 0.2, 0.8]]])
