"""Furniture of few plain boxes: families of their own, with the fraction of shapes that each has."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np

from kpred.synthetic.chance import pick
from kpred.synthetic.coarse.cabinets import COARSE_CASES
from kpred.synthetic.coarse.chairs import COARSE_CHAIRS
from kpred.synthetic.coarse.shelves import COARSE_SHELVES
from kpred.synthetic.coarse.tables import COARSE_TABLES
from kpred.synthetic.part import Part

Family = Callable[[np.random.Generator], list[Part]]

COARSE_FAMILIES: Mapping[str, Mapping[str, Family]] = MappingProxyType(
    {"chair": COARSE_CHAIRS, "table": COARSE_TABLES, "cabinet": {**COARSE_CASES, **COARSE_SHELVES}}
)

_WEIGHT = {"plain_chair": 3.0, "block_chair": 1.5, "post_table": 2.0, "closed_case": 2.0, "backless_case": 3.0}
"""Shares against those of the other families, which count 1: what is plainest is also most common."""


def any_coarse_family(category: str, rng: np.random.Generator) -> str:
    """Name of a family of the category, drawn by weight."""
    names = list(COARSE_FAMILIES[category])
    return pick(rng, names, [_WEIGHT.get(name, 1.0) for name in names])
