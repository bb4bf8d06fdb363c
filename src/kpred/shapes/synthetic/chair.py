"""All structural families of chairs by name."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kpred.shapes.synthetic.chair_modern import MODERN_FAMILIES
from kpred.shapes.synthetic.chair_shells import SHELL_FAMILIES
from kpred.shapes.synthetic.chair_upholstered import UPHOLSTERED_FAMILIES
from kpred.shapes.synthetic.chair_wooden import WOODEN_FAMILIES
from kpred.shapes.synthetic.parts import Part

CHAIR_FAMILIES: dict[str, Callable[[np.random.Generator], list[Part]]] = {
    **WOODEN_FAMILIES,
    **MODERN_FAMILIES,
    **SHELL_FAMILIES,
    **UPHOLSTERED_FAMILIES,
}
