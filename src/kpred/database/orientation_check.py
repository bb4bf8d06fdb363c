"""Whether CAD models stand upright: catalogues of programs whose up axis is z come lying on their backs."""

from __future__ import annotations

import zlib

import numpy as np
import torch

from kpred.errors import MeshError
from kpred.nn import Recognizer
from kpred.ops.sampling import sample_surface
from kpred.ops.typing import Float
from kpred.shapes.mesh import Mesh

_POINTS = 384
_YAWS = np.radians(np.arange(0, 360, 45))
_OTHERS = ("z", "-z", "-y")
"""Axes that are compared with y; lying sideways a cabinet looks like another one."""

_MARGIN = 1.5
"""Mean log-odds by which another axis must be more likely. Of 360 upright models of six sources, in groups of one, the
margin of z is above it for two; of the mean of ten, for none."""


class OrientationCheck:
    """Collects how likely models are with each up axis, and says which axis a catalogue seems to have."""

    def __init__(self, recognizer: Recognizer, most: int = 16) -> None:
        """Start a check of the first `max_samples` models of each category."""
        self._recognizer = recognizer
        self._max_samples = most
        self._odds: dict[str, list[np.ndarray]] = {}

    def observe(self, mesh: Mesh, model_id: str, category: str) -> None:
        """Take one model, y up as far as is known, into account."""
        seen = self._odds.setdefault(category, [])
        if category not in self._recognizer.config.categories or len(seen) >= self._max_samples:
            return
        generator = torch.Generator().manual_seed(zlib.crc32(model_id.encode("utf-8", "surrogatepass")))
        raw = mesh.vertices.astype(np.float64)
        vertices = (raw - raw.mean(axis=0)) / max(float(np.ptp(raw, axis=0).max()), 1e-300)
        try:
            points, _ = sample_surface(
                torch.from_numpy(vertices), torch.from_numpy(mesh.faces).long(), _POINTS, generator
            )
        except MeshError:  # The build itself reports it.
            return
        seen.append(self._log_odds(points.double().numpy(), category))

    def warning(self) -> str | None:
        """Return a sentence about an axis that is more likely up than y, or None."""
        for category, odds in self._odds.items():
            if not odds:
                continue
            mean = np.mean(odds, axis=0)
            best = int(mean[1:].argmax())
            if mean[best + 1] > mean[0] + _MARGIN:
                axis = _OTHERS[best]
                return f"The models of {category} seem to have {axis} up, not y; build again with --up {axis} if so."
        return None

    def _log_odds(self, points: Float[np.ndarray, "points 3"], category: str) -> Float[np.ndarray, " axes"]:
        """Predict log-odds of the category against none, for each up axis, in the best of eight yaws."""
        rotations = [_yaw(angle) @ up_rotation(axis) for axis in ("y", *_OTHERS) for angle in _YAWS]
        clouds = np.stack([points @ rotation.T for rotation in rotations])
        clouds = clouds - clouds.mean(axis=1, keepdims=True)
        clouds = clouds / max(float(np.abs(clouds).max()), np.finfo(np.float64).tiny)
        with torch.inference_mode():
            logits, _ = self._recognizer.predict_ensemble(torch.from_numpy(clouds).float())
            logs = torch.log_softmax(logits, dim=1)
        column = self._recognizer.config.categories.index(category)
        odds: np.ndarray = (logs[:, column] - logs[:, -1]).double().numpy().reshape(-1, len(_YAWS)).max(axis=1)
        return odds


def up_rotation(axis: str) -> Float[np.ndarray, "3 3"]:
    """Return the rotation of the named axis to +y; for z: (x, y, z) -> (x, z, -y)."""
    return {
        "y": np.eye(3),
        "-y": np.diag([1.0, -1.0, -1.0]),
        "z": np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]),
        "-z": np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]),
        "x": np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]),
        "-x": np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]]),
    }[axis]


def _yaw(angle: float) -> Float[np.ndarray, "3 3"]:
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([[cosine, 0, sine], [0, 1, 0], [-sine, 0, cosine]])
