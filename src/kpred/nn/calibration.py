"""Calibration of a model's confidence: a logistic regression, kept in the model's folder beside its weights."""

from __future__ import annotations

import json
import math
import os
import tempfile
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from kpred.errors import ModelError, OutputError

CALIBRATION_FILE = "calibration.json"


@dataclass(frozen=True)
class Calibration:
    """Weights from the evidence of a fit to the log-odds that its result is right.

    Attributes:
        features: names of the features; the last is the recognizer's log-odds.
        weights: of each feature; weights_without_odds: where there is no recognizer, of all but the last.
        made_from: data, seed, versions and held-out reliability, as plain values.

    Raises:
        ModelError: the numbers of features and weights differ, or a weight is not finite.
    """

    features: tuple[str, ...]
    weights: tuple[float, ...]
    weights_without_odds: tuple[float, ...]
    made_from: dict[str, Any]

    def __post_init__(self) -> None:
        count = len(self.features)
        if (len(self.weights), len(self.weights_without_odds)) != (count, count - 1):
            raise ModelError(f"A calibration of {count} features needs as many weights, and one less without odds.")
        if not all(math.isfinite(weight) for weight in (*self.weights, *self.weights_without_odds)):
            raise ModelError("A calibration has a weight that is not finite.")


def load_calibration(folder: str | os.PathLike[str]) -> Calibration | None:
    """Read the calibration of a model's folder; None where it has none.

    Raises:
        ModelError: the file is damaged.
    """
    file = Path(folder) / CALIBRATION_FILE
    if not file.is_file():
        return None
    try:
        values = json.loads(file.read_text(encoding="utf-8"))
        return Calibration(
            tuple(str(name) for name in values["features"]),
            tuple(float(weight) for weight in values["weights"]),
            tuple(float(weight) for weight in values["weights_without_odds"]),
            dict(values["made_from"]),
        )
    except (OSError, ValueError, KeyError, TypeError, ModelError) as error:
        raise ModelError(f"{file} is damaged ({error}); run `kpred train confidence` again.") from error


def save_calibration(calibration: Calibration, folder: str | os.PathLike[str]) -> Path:
    """Write the calibration into a model's folder, whole or not at all; returns the file.

    Raises:
        OutputError: the folder cannot be written.
    """
    target = Path(folder) / CALIBRATION_FILE
    try:
        with tempfile.TemporaryDirectory(dir=folder) as scratch:
            made = Path(scratch) / CALIBRATION_FILE
            made.write_text(json.dumps(asdict(calibration), indent=2, allow_nan=False) + "\n", encoding="utf-8")
            os.replace(made, target)
    except OSError as error:
        raise OutputError(
            f"The calibration cannot be written to {folder} ({error.strerror}); make the folder, or free space."
        ) from error
    return target
