"""Calibration of confidence: fits of virtual scans, whether each is right, and the logistic regression over them."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import minimize

from kpred.errors import ConfigError, MeshError, PackError
from kpred.evaluation.database_source import Progress, content_hash
from kpred.evaluation.header import versions
from kpred.evaluation.metrics.reliability import Reliability, reliability
from kpred.evaluation.metrics.surfaces import Surface
from kpred.evaluation.metrics.symmetry import yaw_between, yaw_error
from kpred.evaluation.scans.calibration_scans import make_calibration_scan
from kpred.evaluation.scans.outcome import YAW_RIGHT, FailedFit, FitSettings, moved, try_fit
from kpred.evaluation.scans.scan_outcomes import NEAR
from kpred.evaluation.scans.targets import ScanTarget
from kpred.evaluation.tables.packs import pack_files
from kpred.evaluation.tables.targets import chosen_rows, make_target
from kpred.fitting import Fit
from kpred.fitting.confidence import FEATURES, Evidence, explained_factor
from kpred.nn.calibration import Calibration
from kpred.ops.typing import Bool, Float
from kpred.shapes import MeshPack

SIGNS, MIN_WEIGHT = (-1, -1, 1, 1, 1, -1, -1, 1), 0.05
"""Signs of the weights of all features but the constant, and their least size: chance in a few hundred scans must not
make a worse fit count as better."""

PENALTY = 0.02
"""Of the weights' squares, so that no single one grows without need."""

MIN_SAMPLES = 20

WITH_ODDS, WITHOUT_ODDS = "with odds", "without odds"


@dataclass(frozen=True)
class CalibrationSample:
    """One fit: the evidence that it gives, and whether its result is right.

    Attributes:
        category: of the true shape; kind: of the scan (`kpred.evaluation.scans.calibration_scans`).
    """

    category: str
    kind: str
    right: bool
    evidence: Evidence

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return asdict(self)

    @classmethod
    def from_json(cls, values: dict[str, Any]) -> CalibrationSample:
        """Undo `to_json`."""
        return cls(**{**values, "evidence": Evidence(**values["evidence"])})


def collect_samples(
    packs: Sequence[str | os.PathLike[str]],
    settings: FitSettings,
    *,
    split: str = "val",
    limit: int | None = 150,
    progress: Progress | None = None,
    report: Callable[[str], None] = lambda sentence: None,
) -> list[CalibrationSample]:
    """Fit virtual scans of shapes, of each pack at most `limit` drawn by seed, up axis given.

    Args:
        packs: of categories of the model and, as category `other`, of other things; files or folders.
        report: called with one sentence for each shape or scan without a result.

    Raises:
        PackError: a pack is missing, damaged, or has no shapes of the split.
    """
    samples: list[CalibrationSample] = []
    for file in pack_files(packs):
        pack = MeshPack.load(file)
        rows = chosen_rows(pack, split, limit, settings.seed)
        if not rows:
            raise PackError(f"{file}: no shape is in the split '{split}'; choose another split.")
        for done, row in enumerate(rows, start=1):
            # The shape before, the last one for the first.
            neighbour = rows[done - 2]
            try:
                other = (
                    make_target(pack[neighbour], str(pack.model_id[neighbour]), settings.seed).points.double().numpy()
                )
                scan = make_calibration_scan(pack[row], str(pack.model_id[row]), other, settings.seed)
            except MeshError as error:
                report(f"left out: {error}")
                continue
            found = try_fit(scan.target.scan, settings, up="y")
            if isinstance(found, FailedFit):
                report(f"no result: {pack.model_id[row]}: {found.reason}")
            else:
                right = pack.category == found.category and is_right(found, scan.target)
                samples.append(CalibrationSample(pack.category, scan.kind, right, found.evidence))
            if progress is not None:
                progress(f"{pack.category}: scans", done, len(rows))
    return samples


def is_right(found: Fit, target: ScanTarget) -> bool:
    """Decide whether yaw is right up to symmetry, and the whole surface near the result."""
    error = yaw_error(yaw_between(found.frame.rotation, target.frame.rotation), target.symmetry)
    distance = Surface(moved(found.mesh, target.frame)).distances(target.whole).mean()
    return error <= YAW_RIGHT and bool(distance < NEAR)


def calibrate(
    samples: Sequence[CalibrationSample], made_from: dict[str, Any]
) -> tuple[Calibration, dict[str, Reliability]]:
    """Fit weights to all samples, with and without the recognizer's odds; and how reliable those of one half are.

    Args:
        samples: in an order that has nothing to do with their outcome.
        made_from: what they were made from, as plain values.

    Returns:
        The calibration; and, with and without odds, the reliability of weights of one half on the other.

    Raises:
        ConfigError: there are too few samples, or all are right, or all wrong.
    """
    right = np.array([sample.right for sample in samples], dtype=bool)
    if len(samples) < MIN_SAMPLES or right.all() or not right.any():
        raise ConfigError(
            f"{len(samples)} fits, {int(right.sum())} of them right, cannot be calibrated on: at least {MIN_SAMPLES} "
            "are needed, both right and wrong ones; give more shapes."
        )
    without = np.stack([replace(one.evidence, odds=None).features() for one in samples])
    sets = {WITHOUT_ODDS: without}
    if all(one.evidence.odds is not None for one in samples):
        sets[WITH_ODDS] = np.stack([one.evidence.features() for one in samples])
    factor = np.array([explained_factor(sample.evidence.unexplained) for sample in samples])
    weights = {name: regression(features, right, factor) for name, features in sets.items()}
    # A model without a recognizer has no odds to weigh.
    weights.setdefault(WITH_ODDS, np.append(weights[WITHOUT_ODDS], 0.0))
    held_out = {name: _held_out(features, right, factor) for name, features in sets.items()}
    facts = made_from | {
        "samples": len(samples),
        "right": int(right.sum()),
        "held_out": {name: {"n": one.n, "ece": one.ece, "auc": one.auc} for name, one in held_out.items()},
        "versions": versions(),
    }
    return Calibration(FEATURES, _rounded(weights[WITH_ODDS]), _rounded(weights[WITHOUT_ODDS]), facts), held_out


def regression(
    features: Float[np.ndarray, "samples features"],
    right: Bool[np.ndarray, " samples"],
    factor: Float[np.ndarray, " samples"] | None = None,
) -> np.ndarray:
    """Compute the weights (features,) of the likeliest logistic model with a small penalty, of the right signs.

    `factor`: what the model's probability of each sample is multiplied by; None stands for 1.
    """
    known = np.ones(len(right)) if factor is None else factor

    def loss(weights: np.ndarray) -> float:
        said = np.clip(probability(features, weights) * known, 1e-12, 1 - 1e-12)
        return float(-np.log(np.where(right, said, 1 - said)).mean() + PENALTY * np.square(weights[1:]).mean())

    limits = [(MIN_WEIGHT, 20.0) if one > 0 else (-20.0, -MIN_WEIGHT) for one in SIGNS]
    bounds = [(-20.0, 20.0), *limits][: features.shape[1]]
    start = np.zeros(features.shape[1])
    return np.asarray(minimize(loss, start, method="L-BFGS-B", bounds=bounds).x)


def probability(features: Float[np.ndarray, "samples features"], weights: np.ndarray) -> Float[np.ndarray, " samples"]:
    """Compute the probability of being right, row by row."""
    return np.asarray(1 / (1 + np.exp(-np.clip(features @ weights, -30, 30))))


def _held_out(features: np.ndarray, right: np.ndarray, factor: np.ndarray) -> Reliability:
    """Reliability on every second sample, of weights from the others."""
    half = np.arange(len(right)) % 2 == 0
    weights = regression(features[half], right[half], factor[half])
    said = probability(features[~half], weights) * factor[~half]
    return reliability(said.tolist(), right[~half].tolist())


def _rounded(weights: np.ndarray) -> tuple[float, ...]:
    return tuple(round(float(weight), 4) for weight in weights)


def sources_of(packs: Sequence[str | os.PathLike[str]]) -> list[dict[str, str]]:
    """List name and hash of each pack."""
    return [{"file": file.name, "sha256": content_hash(Path(file))} for file in pack_files(packs)]
