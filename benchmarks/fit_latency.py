"""How long a fit takes, from points in memory to the mesh, with model and database warm.

    python benchmarks/fit_latency.py [--scans 50] [--threads 2]

Median and 90th percentile over full scans of 2048 points (shapes of the generator that are in no database), top 10, on
the bundled model and database: category given or not, ways of deforming, frame known or found. Beside it, scan by scan
in the same run, the plain path: nearest neighbours by brute force and keypoints refined by plain torch; the structure-
keeping fit is compiled in both. Processor time is given too, which other work disturbs less than the clock.
"""

# ruff: noqa: I001
from __future__ import annotations

import argparse
import json
import os
import time
from contextlib import ExitStack
from unittest.mock import patch

import kpred  # before torch, to say how its threads wait

import numba
import numpy as np
import torch

import kpred.ops.nearest as nearest
from kpred.fitting import fit
from kpred.refinement import keypoints as refine
from kpred.fitting.defaults import bundled_database_path
from kpred.ops import sample_surface, unit_box_frame, weighted_sums
from kpred.ops.nearest_cpu import nearest_brute
from kpred.synthetic.generator import generate

CASES = {
    "category given, frame found": {},
    "category given, frame found, undeformed": {"deform": "none"},
    "category given, frame found, paper's protocol": {"deform": "paper"},
    "category given, frame known": {"frame": "known"},
    "category given, frame known, keypoints refined": {"deform": "free", "frame": "known"},
    "everything unknown": {"category": None},
}


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scans", type=int, default=50)
    parser.add_argument("--threads", type=int, default=2)
    options = parser.parse_args()
    torch.set_num_threads(options.threads)
    numba.set_num_threads(min(options.threads, numba.config.NUMBA_NUM_THREADS))
    model = kpred.load_model()
    database = kpred.Database.open(bundled_database_path(), read_only=True)
    scans = {category: _scans(category, options.scans // 3 + 1) for category in model.categories}
    rows = []
    for name, arguments in CASES.items():
        wall, processor, plain = [], [], []
        for category, clouds in scans.items():
            chosen = {"category": category, **arguments}
            fit(clouds[0], model, database, **chosen)
            for cloud in clouds[1:]:
                with _plain():
                    plain.append(_seconds(cloud, model, database, chosen)[1])
                taken = _seconds(cloud, model, database, chosen)
                wall.append(taken[0])
                processor.append(taken[1])
        rows.append(
            {
                "case": name,
                "median_ms": _milliseconds(wall, 0.5),
                "p90_ms": _milliseconds(wall, 0.9),
                "processor_ms": _milliseconds(processor, 0.5),
                "plain_processor_ms": _milliseconds(plain, 0.5),
                "ratio_to_plain": round(float(np.median(np.array(processor) / np.array(plain))), 2),
                "n": len(wall),
            }
        )
    print(json.dumps({"threads": options.threads, "load": os.getloadavg()[0], "rows": rows}, indent=2))


def _plain() -> ExitStack:
    """While it is entered, fits go the plain way."""
    stack = ExitStack()
    stack.enter_context(patch.object(nearest, "nearest_cpu", nearest_brute))
    stack.enter_context(patch.object(refine, "refine_compiled", None))
    stack.enter_context(patch.object(weighted_sums, "compiled", None))
    return stack


def _seconds(cloud: np.ndarray, model: object, database: object, arguments: dict[str, object]) -> tuple[float, float]:
    started, busy = time.perf_counter(), time.process_time()
    fit(cloud, model, database, **arguments)
    return time.perf_counter() - started, time.process_time() - busy


def _milliseconds(seconds: list[float], share: float) -> float:
    return round(1000 * float(np.quantile(seconds, share)), 1)


def _scans(category: str, count: int) -> list[np.ndarray]:
    generator = torch.Generator().manual_seed(0)
    pack = generate(category, count, seed=99)
    clouds = []
    for mesh in pack:
        vertices, faces = torch.from_numpy(mesh.vertices), torch.from_numpy(mesh.faces).long()
        cloud = sample_surface(vertices, faces, 2048, generator)[0].double().numpy()
        clouds.append(unit_box_frame(cloud).to_unit(cloud))
    return clouds


if __name__ == "__main__":
    main()
