"""Fits and training steps a second on a GPU, beside what it could do at most. Needs torch, numpy and safetensors alone.

    PYTHONPATH=src python benchmarks/gpu.py -o gpu.json

The shares say how much of a run's time the device would need, at its own measured peak, for the arithmetic that was
counted and for the bytes that all operations read and write; what both leave is mostly the starting of operations.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from pathlib import Path

import torch
from device_rates import Rate, Sizes, device_figures, record_of

SMALL = Sizes(batch=2, models=6, top_k=3, shapes=6, repeats=1, matrix=256, points=256)


def main() -> None:
    """Measure, print, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", default="cuda" if torch.cuda.is_available() else "cpu")
    parser.add_argument("--batch", type=int, default=None, help="scans of a fit")
    parser.add_argument("--small", action="store_true", help="little of everything, to see that it works")
    parser.add_argument("-o", "--output", type=Path, default=None)
    arguments = parser.parse_args()
    sizes = SMALL if arguments.small else Sizes()
    if arguments.batch is not None:
        sizes = replace(sizes, batch=arguments.batch)
    device = torch.device(arguments.device)
    most, rates = device_figures(device, sizes, lambda line: print(line, flush=True))
    record = record_of(device, sizes, most, rates)
    print(table(rates))
    text = json.dumps(record, indent=1)
    if arguments.output is not None:
        arguments.output.write_text(text + "\n")
    print(json.dumps(record))


def table(rates: list[Rate]) -> str:
    """One line a figure."""
    lines = [
        f"{'':64} {'a second':>9} {'ms a run':>9} {'GFLOP':>8} {'GB':>7} {'arithm.':>8} {'memory':>7} {'started':>8}"
    ]
    for rate in rates:
        cost = rate.cost
        lines.append(
            f"{rate.name:64} {rate.rate:9.1f} {1000 * rate.seconds:9.2f} {cost.products / 1e9:8.1f} "
            f"{cost.traffic / 1e9:7.2f} {rate.arithmetic:8.1%} {rate.memory:7.1%} {cost.operations:8}"
        )
    return "\n".join(lines)


if __name__ == "__main__":
    main()
