"""Fit the logistic regressions of `kpred.fitting.confidence` on virtual scans, and print them as code.

    python scripts/calibrate_confidence.py [-n 150] [--evidence evidence.json]

The scans are of generated shapes of a seed that neither training, database nor reports use: of each category, and of
other things, n depth scans, some of whole surfaces, some of fragments. Evidence is kept in a file, so that the
regressions can be fitted again. Half of the scans fit the weights, the other half says how well they are calibrated.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np
from scipy.optimize import minimize

import kpred
from kpred.errors import KpredError
from kpred.evaluation.reliability import reliability
from kpred.evaluation.scan_outcomes import NEAR, YAW_RIGHT, moved
from kpred.evaluation.scan_targets import ScanTarget, make_scan_target
from kpred.evaluation.surfaces import Surface
from kpred.evaluation.symmetry import yaw_between, yaw_error
from kpred.fitting.confidence import Evidence
from kpred.shapes.synthetic.generator import generate

SEED = 33
CATEGORIES = ("chair", "table", "cabinet", "other")
WHOLE, FRAGMENT = 0.2, 0.15
"""Shares of scans that show the whole surface, and that show a fragment only."""
SIGNS, LEAST = (-1, -1, 1, 1, 1, -1, 1), 0.05
"""Signs of the weights of error, unexplained, seen, category, turn, box and odds, and their least size: chance in a few
hundred scans must not make a worse fit count as better."""
PENALTY = 0.02
"""Of the weights' squares, so that no single one grows without need."""


def main() -> None:
    """Collect the evidence or read it, fit, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-n", type=int, default=150, help="scans of each category and of other things")
    parser.add_argument("--evidence", type=Path, default=Path("evidence.json"))
    options = parser.parse_args()
    if not options.evidence.exists():
        options.evidence.write_text(json.dumps(collect(options.n)))
    rows = json.loads(options.evidence.read_text())
    right = np.array([row["right"] for row in rows])
    found = [Evidence(**row["evidence"]) for row in rows]
    without = [Evidence(**{**row["evidence"], "odds": None}) for row in rows]
    for name, evidence in (("WEIGHTS", found), ("WEIGHTS_WITHOUT_ODDS", without)):
        features = np.stack([one.features() for one in evidence])
        half = np.arange(len(rows)) % 2 == 0
        said = probability(features[~half], regression(features[half], right[half]))
        told = reliability(said.tolist(), right[~half].tolist())
        print(f"held out: n {told.n}, ECE {told.ece:.3f}, AUC {told.auc:.3f}, right {right[~half].mean():.2f}")
        print(f"{name} = np.array({[round(float(weight), 3) for weight in regression(features, right)]})")


def collect(count: int) -> list[dict[str, object]]:
    """Evidence and outcome of every scan."""
    model, database = kpred.load_model(), kpred.Database.open(kpred.fitting.bundled_database_path(), read_only=True)
    rows: list[dict[str, object]] = []
    for category in CATEGORIES:
        pack = generate(category, count, SEED, cuboids=0.0 if category == "other" else 0.4, splits=False)
        for index in range(len(pack)):
            target = make_scan_target(pack[index], str(pack.model_id[index]), SEED)
            kind, points = shown(target, np.random.default_rng([SEED, index]))
            try:
                fit = kpred.fit(points, model, database, up="y")
            except KpredError:
                continue
            rows.append(
                {
                    "category": category,
                    "kind": kind,
                    "right": category == fit.category and is_right(fit, target),
                    "evidence": fit.evidence.__dict__,
                }
            )
            if index % 10 == 9:
                print(f"{category}: {index + 1} of {count}", flush=True)
    return rows


def shown(target: ScanTarget, rng: np.random.Generator) -> tuple[str, np.ndarray]:
    """What a scan shows: a depth scan, the whole surface, or a fragment of the depth scan."""
    lot = rng.random()
    if lot < WHOLE:
        return "whole", target.frame.from_unit(target.whole)
    if lot < WHOLE + FRAGMENT:
        distance = np.linalg.norm(target.scan - target.scan[rng.integers(len(target.scan))], axis=1)
        near = np.argsort(distance)[: max(100, int(rng.uniform(0.05, 0.4) * len(distance)))]
        return "fragment", target.scan[np.sort(near)]
    return "scan", target.scan


def is_right(fit: kpred.Fit, target: ScanTarget) -> bool:
    """Yaw right up to symmetry, and the whole surface near the result."""
    turn = yaw_error(yaw_between(fit.frame.rotation, target.frame.rotation), target.symmetry)
    distance = Surface(moved(fit.mesh, target.frame), 0).distances(target.whole).mean()
    return turn <= YAW_RIGHT and bool(distance < NEAR)


def regression(features: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Weights of the likeliest logistic model with a small penalty, and with the signs that they must have."""
    sign = np.where(right, 1.0, -1.0)

    def loss(weights: np.ndarray) -> float:
        return float(np.logaddexp(0, -sign * (features @ weights)).mean() + PENALTY * np.square(weights[1:]).mean())

    bounds = [(-20.0, 20.0), *((LEAST, 20.0) if sign > 0 else (-20.0, -LEAST) for sign in SIGNS)][: features.shape[1]]
    return np.asarray(minimize(loss, np.zeros(features.shape[1]), method="L-BFGS-B", bounds=bounds).x)


def probability(features: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Of being right, row by row."""
    return np.asarray(1 / (1 + np.exp(-features @ weights)))


if __name__ == "__main__":
    main()
