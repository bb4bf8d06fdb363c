"""How large furniture is: sizes that no chair, table or cabinet has mean a wrong unit of length."""

from __future__ import annotations

import numpy as np

_RANGES = {"chair": (0.3, 2.2), "table": (0.25, 4.0), "cabinet": (0.2, 4.0)}
_ANY = (0.1, 5.0)


def usual_range(category: str) -> tuple[float, float]:
    """Return the least and the greatest longest side of furniture of a category, metres."""
    return _RANGES.get(category, _ANY)


def size_warning(size: np.ndarray, category: str, remedy: str) -> str | None:
    """Return a sentence about an implausible size (3,) in metres, or None where it is plausible.

    Args:
        remedy: how to give the right unit, the end of the sentence.
    """
    smallest, largest = usual_range(category)
    longest = float(np.max(size))
    if smallest <= longest <= largest:
        return None
    word = "large" if longest > largest else "small"
    sides = " x ".join(f"{side:.2g}" for side in size)
    return f"It is {sides} m, too {word} for a {category}: the unit of the depths may be wrong; {remedy}."
