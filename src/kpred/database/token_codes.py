"""8-bit codes of tokens, and what they say for certain about weighted L1 distances.

A token t is stored as a whole number of steps above the lowest value of its dimension; the step is one for all
dimensions of a keypoint, so that differences of codes add up. With e the sum of |t - decoded t| over a keypoint's
dimensions, kept for each model, the distance at that keypoint lies within e (and the query's own error) of what the
codes say. The bounds hold for every model, so a search that goes on until they close is exact.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kpred.database.token_codes_cpu import LANES, bounds_cpu, encode_cpu
from kpred.ops.typing import Float, UInt8

GROUP = 2
"""Keypoints of a plane: what is read at once of a model before it can be given up (256 bytes of tokens of 128)."""

_LEVELS = 255


@dataclass(frozen=True)
class CodeLayout:
    """How codes of M models with K keypoints of C dimensions lie: planes x models x group x size."""

    keypoints: int
    token_size: int

    @property
    def group(self) -> int:
        """Keypoints of a plane."""
        return min(GROUP, self.keypoints)

    @property
    def planes(self) -> int:
        """Planes; the last may hold keypoints that do not exist, whose codes are 0."""
        return -(-self.keypoints // self.group)

    @property
    def size(self) -> int:
        """Bytes of a keypoint, padding included."""
        return -(-self.token_size // LANES) * LANES

    def planar(self, values: np.ndarray) -> np.ndarray:
        """Rearrange (M, K, S) or (M, K) to (G, M, P, ...), with zeros for keypoints that do not exist."""
        missing = self.planes * self.group - self.keypoints
        padded = np.pad(values, [(0, 0), (0, missing), *[(0, 0)] * (values.ndim - 2)])
        return np.moveaxis(padded.reshape(len(values), self.planes, self.group, *values.shape[2:]), 1, 0)


@dataclass(frozen=True, eq=False)
class Quantiser:
    """From tokens to codes.

    Attributes:
        lowest: (K, C) float64, the code 0 of each dimension; step: (K,) float64, the worth of one code.
    """

    lowest: Float[np.ndarray, "keypoints token_size"]
    step: Float[np.ndarray, " keypoints"]

    @classmethod
    def of_range(
        cls, lowest: Float[np.ndarray, "keypoints token_size"], highest: Float[np.ndarray, "keypoints token_size"]
    ) -> Quantiser:
        """Build a quantiser for tokens between `lowest` and `highest` (K, C)."""
        span = (highest.astype(np.float64) - lowest).max(axis=1)
        return cls(lowest.astype(np.float64), np.maximum(span / _LEVELS, 1e-12))

    @property
    def error_unit(self) -> np.ndarray:
        """(K,) the worth of one step of the stored errors: 255 of them are more than rounding can miss."""
        return self.step * (0.5000001 * self.lowest.shape[1] / _LEVELS)

    def encode(
        self, tokens: np.ndarray
    ) -> tuple[UInt8[np.ndarray, "models keypoints token_size"], UInt8[np.ndarray, "models keypoints"]]:
        """Quantise tokens (M, K, C) to codes (M, K, C) and errors (M, K), rounded up, both uint8."""
        return encode_cpu(tokens, self.lowest, self.step, self.error_unit)

    def encode_query(self, query: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Quantise a query (K, C) to codes uint8, distances from the range (K,), errors (K,)."""
        exact = query.astype(np.float64)
        inside = np.clip(exact, self.lowest, self.lowest + _LEVELS * self.step[:, None])
        codes = np.clip(np.rint((inside - self.lowest) / self.step[:, None]), 0, _LEVELS)
        decoded = self.lowest + codes * self.step[:, None]
        return codes.astype(np.uint8), np.abs(exact - inside).sum(axis=1), np.abs(inside - decoded).sum(axis=1)


def bounds(
    codes: np.ndarray,
    errors: np.ndarray,
    quantiser: Quantiser,
    query: np.ndarray,
    weights: np.ndarray,
    top_k: int,
) -> tuple[np.ndarray, float]:
    """Lower bounds (M,) of the distances of all models, and a number that the `top_k` nearest do not exceed.

    Args:
        codes: (G, M, P, S) uint8, planar; errors: (G, M, P) uint8.
        query: (K, C); weights: (K,) of at least 0.

    A model whose bound is infinite, or above that number, is not among the `top_k` nearest.
    """
    layout = CodeLayout(*query.shape)
    query_codes, factors = _prepared(quantiser, query, weights, layout)
    # Heavy planes first: what they say ends the reading of most models.
    order = np.argsort(-factors[0].sum(axis=1), kind="stable")
    lower = np.empty(codes.shape[1], np.float32)
    most = bounds_cpu(codes.reshape(-1), errors.reshape(-1), query_codes, order, factors, top_k, lower)
    # Sums of float64 and the float32 of `lower` are off by less than this.
    return lower * np.float32(1 - 1e-6), most * (1 + 1e-6)


def bounds_reference(
    codes: np.ndarray, errors: np.ndarray, quantiser: Quantiser, query: np.ndarray, weights: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper bounds (M,) float64 of all models, in plain numpy."""
    layout = CodeLayout(*query.shape)
    query_codes, (step, unit, outside, slack) = _prepared(quantiser, query, weights, layout)
    differences = np.abs(codes.astype(np.int64) - query_codes[:, None]).sum(axis=3)
    middle = step[:, None] * differences + outside[:, None]
    error = unit[:, None] * errors + slack[:, None]
    return np.maximum(middle - error, 0).sum(axis=(0, 2)), (middle + error).sum(axis=(0, 2))


def _prepared(
    quantiser: Quantiser, query: np.ndarray, weights: np.ndarray, layout: CodeLayout
) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]:
    """Compute codes (G, P, S) of a query and the four factors (G, P) of `codes_cpu.bounds_cpu`."""
    codes, outside, slack = quantiser.encode_query(query)
    padded = np.pad(codes, [(0, 0), (0, layout.size - layout.token_size)])
    weigh = np.asarray(weights, dtype=np.float64)
    step, unit, far, own = (
        np.ascontiguousarray(layout.planar((weigh * values)[None])[:, 0])
        for values in (quantiser.step, quantiser.error_unit, outside, slack)
    )
    return np.ascontiguousarray(layout.planar(padded[None])[:, 0]), (step, unit, far, own)
