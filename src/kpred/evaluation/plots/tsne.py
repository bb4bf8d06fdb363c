"""t-SNE (van der Maaten and Hinton, 2008), exact, for some thousand points: near neighbours stay near."""

from __future__ import annotations

import numpy as np

from kpred.ops.typing import Float

_EXAGGERATION, _EXAGGERATED = 12.0, 250
_SLOW, _FAST = 0.5, 0.8
_SMALLEST_GAIN = 0.01


def tsne(
    distances: Float[np.ndarray, "points points"], perplexity: float = 30.0, steps: int = 750, seed: int = 0
) -> Float[np.ndarray, "points 2"]:
    """Map N points, of which only the distances are known, to the plane.

    Args:
        distances: symmetric, any metric, zero on the diagonal.
        perplexity: how many neighbours count; at most a third of the points.
        steps: of gradient descent with momentum and gains, the first 250 with exaggerated attraction.
        seed: of the first places.
    """
    count = len(distances)
    if count < 4:
        return np.random.default_rng(seed).normal(size=(count, 2))
    wanted = joint_probabilities(distances, min(perplexity, (count - 1) / 3))
    places = np.random.default_rng(seed).normal(scale=1e-4, size=(count, 2))
    velocity, gains = np.zeros_like(places), np.ones_like(places)
    rate = max(count / _EXAGGERATION / 4, 50.0)
    for step in range(steps):
        early = step < _EXAGGERATED
        gradient = _gradient(wanted * (_EXAGGERATION if early else 1.0), places)
        turned = np.sign(gradient) != np.sign(velocity)
        gains = np.where(turned, gains + 0.2, gains * 0.8).clip(_SMALLEST_GAIN)
        velocity = (_SLOW if early else _FAST) * velocity - rate * gains * gradient
        places = places + velocity
        places -= places.mean(axis=0)
    return places


def joint_probabilities(
    distances: Float[np.ndarray, "points points"], perplexity: float
) -> Float[np.ndarray, "points points"]:
    """Symmetric probabilities that sum to 1; each point's own have this perplexity."""
    squared = np.square(np.asarray(distances, dtype=np.float64))
    count = len(squared)
    conditional = np.zeros_like(squared)
    for row in range(count):
        others = np.delete(squared[row], row)
        # Scale first: tokens may be in any unit.
        others = others / max(float(others.mean()), 1e-300)
        conditional[row, np.arange(count) != row] = _with_perplexity(others, perplexity)
    return np.maximum((conditional + conditional.T) / (2 * count), 1e-12)


def _with_perplexity(squared: np.ndarray, perplexity: float) -> np.ndarray:
    """Normalised exp(-beta squared) with beta by bisection, so that its entropy is log(perplexity)."""
    low, high, beta = 0.0, np.inf, 1.0
    probability = np.full(len(squared), 1 / len(squared))
    for _ in range(64):
        weight = np.exp(-beta * (squared - squared.min()))
        probability = weight / weight.sum()
        entropy = -float((probability * np.log(np.maximum(probability, 1e-300))).sum())
        if abs(entropy - np.log(perplexity)) < 1e-5:
            break
        if entropy > np.log(perplexity):
            low = beta
            beta = beta * 2 if np.isinf(high) else (beta + high) / 2
        else:
            high = beta
            beta = (beta + low) / 2
    return probability


def _gradient(wanted: np.ndarray, places: np.ndarray) -> np.ndarray:
    difference = places[:, None] - places[None]
    kernel = 1 / (1 + np.square(difference).sum(-1))
    np.fill_diagonal(kernel, 0.0)
    found = np.maximum(kernel / kernel.sum(), 1e-12)
    pull = (wanted - found) * kernel
    return np.asarray(4 * (pull[..., None] * difference).sum(1))
