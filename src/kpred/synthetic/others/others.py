"""All families of things that are neither chair, table nor cabinet: what a scan may hold instead.

Sofas and plain closed boxes are left out, because they are indistinguishable from armchairs and cabinets.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import chain, zip_longest

import numpy as np

from kpred.shapes.pack import MeshPack
from kpred.synthetic.generator import generate
from kpred.synthetic.others.building import BUILDING_FAMILIES
from kpred.synthetic.others.fragments import FRAGMENT_FAMILIES
from kpred.synthetic.others.household import HOUSEHOLD_FAMILIES
from kpred.synthetic.others.nature import NATURE_FAMILIES
from kpred.synthetic.parts import Part

Family = Callable[[np.random.Generator], list[Part]]


def _stretched(family: Family) -> Family:
    """Wrap a family so that its shapes are scaled at random, by about 10 % along each axis."""

    def build(rng: np.random.Generator) -> list[Part]:
        factors = np.exp(np.clip(rng.normal(0.0, 0.1, 3), -0.3, 0.3))
        return [part.scaled(factors) for part in family(rng)]

    return build


_GROUPS = (NATURE_FAMILIES, BUILDING_FAMILIES, HOUSEHOLD_FAMILIES, FRAGMENT_FAMILIES)

# The groups take turns, so that a small pack holds something of each.
OTHER_FAMILIES: dict[str, Family] = {
    name: _stretched(family)
    for name, family in filter(None, chain.from_iterable(zip_longest(*(group.items() for group in _GROUPS))))
}


def generate_others(count: int, seed: int) -> MeshPack:
    """Generate a pack of `count` shapes that are no chair, table or cabinet.

    Metres, y up, floor at y = 0, bounding box centred in x and z.

    Raises:
        ConfigError: negative count or seed.

    """
    return generate("other", count, seed)
