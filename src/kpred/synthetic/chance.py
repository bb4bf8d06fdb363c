"""Small random choices that every furniture family makes, all from one generator that the caller passes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import numpy as np

T = TypeVar("T")


def pick(rng: np.random.Generator, options: Sequence[T], weights: Sequence[float | int] | None = None) -> T:
    """Draw one of `options`, with the probabilities `weights` / sum(weights), or uniformly."""
    if weights is None:
        return options[int(rng.integers(len(options)))]
    fractions = np.asarray(weights, dtype=np.float64)
    return options[int(rng.choice(len(options), p=fractions / fractions.sum()))]


def happens(rng: np.random.Generator, probability: float) -> bool:
    """Draw True with the given probability."""
    return bool(rng.random() < probability)


def between(rng: np.random.Generator, low: float | int, high: float | int) -> float:
    """Draw a uniform number in [low, high)."""
    return float(rng.uniform(low, high))


def whole(rng: np.random.Generator, low: int, high: int) -> int:
    """Draw a uniform whole number, `low` and `high` included."""
    return int(rng.integers(low, high + 1))


def fractions(rng: np.random.Generator, count: int, unevenness: float = 0.0) -> list[float]:
    """Draw `count` positive numbers with sum 1, each within the fraction `unevenness` of 1 / count."""
    weights = 1.0 + unevenness * rng.uniform(-1.0, 1.0, size=count)
    return [float(weight) for weight in weights / weights.sum()]
