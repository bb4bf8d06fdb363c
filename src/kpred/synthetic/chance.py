"""Small random choices that every furniture family makes, all from one generator that the caller passes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import numpy as np

T = TypeVar("T")


def pick(rng: np.random.Generator, options: Sequence[T], weights: Sequence[float | int] | None = None) -> T:
    """One of `options`, with the probabilities `weights` / sum(weights), or all alike."""
    if weights is None:
        return options[int(rng.integers(len(options)))]
    shares = np.asarray(weights, dtype=np.float64)
    return options[int(rng.choice(len(options), p=shares / shares.sum()))]


def happens(rng: np.random.Generator, probability: float) -> bool:
    """True with the given probability."""
    return bool(rng.random() < probability)


def between(rng: np.random.Generator, low: float | int, high: float | int) -> float:
    """A uniform number in [low, high)."""
    return float(rng.uniform(low, high))


def whole(rng: np.random.Generator, low: int, high: int) -> int:
    """A uniform whole number, `low` and `high` included."""
    return int(rng.integers(low, high + 1))


def shares(rng: np.random.Generator, count: int, unevenness: float = 0.0) -> list[float]:
    """`count` positive numbers with sum 1; each is off the equal share by up to the fraction `unevenness`."""
    weights = 1.0 + unevenness * rng.uniform(-1.0, 1.0, size=count)
    return [float(weight) for weight in weights / weights.sum()]
