"""The cabinet families: each function draws one piece of storage furniture from a generator.

Frame: metres, y up, floor y = 0, doors, drawers and open bays towards +z.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kpred.synthetic.cabinet.cases import (
    cornice_cabinet,
    filing_cabinet,
    locker,
    shoe_cabinet,
    sliding_wardrobe,
    tall_cabinet,
    wall_cabinet,
    wardrobe,
)
from kpred.synthetic.cabinet.chests import (
    apothecary_chest,
    chest_of_drawers,
    kitchen_base,
    nightstand,
    secretary,
    sideboard,
    tv_stand,
)
from kpred.synthetic.cabinet.displays import (
    corner_cabinet,
    display_steps,
    glass_cabinet,
    hutch,
    round_shelf,
    tv_wall,
)
from kpred.synthetic.cabinet.shelves import (
    asymmetric_shelf,
    bookcase_with_doors,
    cube_grid,
    ladder_shelf,
    open_bookcase,
    rack,
    stepped_bookcase,
)
from kpred.synthetic.parts import Part

CABINET_FAMILIES: dict[str, Callable[[np.random.Generator], list[Part]]] = {
    "wardrobe": wardrobe,
    "sliding_wardrobe": sliding_wardrobe,
    "chest_of_drawers": chest_of_drawers,
    "sideboard": sideboard,
    "tv_stand": tv_stand,
    "kitchen_base": kitchen_base,
    "wall_cabinet": wall_cabinet,
    "tall_cabinet": tall_cabinet,
    "filing_cabinet": filing_cabinet,
    "nightstand": nightstand,
    "cornice": cornice_cabinet,
    "shoe_cabinet": shoe_cabinet,
    "secretary": secretary,
    "locker": locker,
    "apothecary": apothecary_chest,
    "open_bookcase": open_bookcase,
    "cube_grid": cube_grid,
    "stepped": stepped_bookcase,
    "ladder": ladder_shelf,
    "rack": rack,
    "asymmetric": asymmetric_shelf,
    "bookcase_with_doors": bookcase_with_doors,
    "glass": glass_cabinet,
    "hutch": hutch,
    "corner": corner_cabinet,
    "tv_wall": tv_wall,
    "round_shelf": round_shelf,
    "display_steps": display_steps,
}
