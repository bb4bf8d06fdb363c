"""All structural families of chairs by name, each shape stretched a little along its axes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kpred.synthetic.chair.blocks import BLOCK_FAMILIES
from kpred.synthetic.chair.modern import MODERN_FAMILIES
from kpred.synthetic.chair.shells import SHELL_FAMILIES
from kpred.synthetic.chair.upholstered import UPHOLSTERED_FAMILIES
from kpred.synthetic.chair.wooden import WOODEN_FAMILIES
from kpred.synthetic.parts import Part

Family = Callable[[np.random.Generator], list[Part]]


def _stretched(family: Family) -> Family:
    """Wrap a family so that its shapes are scaled at random, by about 7 % along each axis."""

    def build(rng: np.random.Generator) -> list[Part]:
        factors = np.exp(np.clip(rng.normal(0.0, 0.07, 3), -0.2, 0.2))
        return [part.scaled(factors) for part in family(rng)]

    return build


CHAIR_FAMILIES: dict[str, Family] = {
    name: _stretched(family)
    for name, family in {
        **WOODEN_FAMILIES,
        **MODERN_FAMILIES,
        **SHELL_FAMILIES,
        **UPHOLSTERED_FAMILIES,
        **BLOCK_FAMILIES,
    }.items()
}
