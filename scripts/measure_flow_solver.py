"""Measure how exactly ShapeFlow's points are carried, by the number of Runge-Kutta steps.

    python scripts/measure_flow_solver.py runs/shapeflow

Random points of the unit box flow from one shape of the training to another; printed are the mean and the greatest
distance from where 32 steps a way bring them, in lengths of the unit box.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import torch

from kpred.peers.networks import ShapeFlow, load_peers

EXACT, STEPS = 32, (1, 2, 4, 8)
PAIRS, POINTS = 16, 256


def main() -> None:
    """Parse the arguments and print a line for each category and number of steps."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="of a run, or of a run of each category")
    for category, network in load_peers(parser.parse_args().folder).items():
        assert isinstance(network, ShapeFlow)
        generator = torch.Generator().manual_seed(0)
        points = 2 * torch.rand(PAIRS, POINTS, 3, generator=generator) - 1
        pairs = torch.randint(0, len(network.config.sources), (2, PAIRS), generator=generator)
        first, second = network.code(pairs[0]), network.code(pairs[1])
        exact = _carried(network, EXACT, points, first, second)
        print(f"{category}: codes are {first.norm(dim=1).mean():.2f} long")
        for steps in STEPS:
            off = (_carried(network, steps, points, first, second) - exact).norm(dim=2)
            print(f"{category}: {steps} steps: mean {off.mean():.5f}, greatest {off.max():.5f}")


@torch.inference_mode()
def _carried(
    network: ShapeFlow, steps: int, points: torch.Tensor, first: torch.Tensor, second: torch.Tensor
) -> torch.Tensor:
    other = ShapeFlow(replace(network.config, steps=steps))
    other.load_state_dict(network.state_dict())
    return other.from_hub(other.to_hub(points, first), second)


if __name__ == "__main__":
    main()
