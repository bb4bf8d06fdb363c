"""Furniture of few plain boxes: families of their own, with the share of shapes that each has."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np

from kpred.shapes.synthetic.chance import pick
from kpred.shapes.synthetic.coarse_cabinets import COARSE_CASES
from kpred.shapes.synthetic.coarse_chairs import COARSE_CHAIRS
from kpred.shapes.synthetic.coarse_shelves import COARSE_SHELVES
from kpred.shapes.synthetic.coarse_tables import COARSE_TABLES
from kpred.shapes.synthetic.part import Part

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
