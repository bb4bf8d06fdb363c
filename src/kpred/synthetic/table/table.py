"""The table families: each function draws one table's parts from a generator.

Frame: metres, y up, floor y = 0, the long side or the sitter's side (drawers, knee hole) towards +z.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kpred.synthetic.parts import Part
from kpred.synthetic.table.based import (
    c_table,
    cube_table,
    slab_table,
    sled_table,
    trestle_table,
    x_leg_table,
)
from kpred.synthetic.table.columns import (
    double_pedestal_table,
    pedestal_table,
    sculpted_table,
    tripod_table,
)
from kpred.synthetic.table.desks import (
    hutch_desk,
    l_desk,
    open_bay_desk,
    panel_desk,
    pedestal_desk,
    writing_desk,
)
from kpred.synthetic.table.legged import (
    bar_table,
    coffee_table,
    console_table,
    dining_table,
    drawer_side_table,
    drop_leaf_table,
    frame_table,
    nesting_tables,
    picnic_table,
    round_table,
    workbench,
)
from kpred.synthetic.table.office import (
    conference_table,
    counter_desk,
    drafting_table,
    ping_pong_table,
    t_leg_desk,
)

TABLE_FAMILIES: dict[str, Callable[[np.random.Generator], list[Part]]] = {
    "dining": dining_table,
    "round": round_table,
    "coffee": coffee_table,
    "console": console_table,
    "bar": bar_table,
    "frame": frame_table,
    "nesting": nesting_tables,
    "picnic": picnic_table,
    "drop_leaf": drop_leaf_table,
    "drawer_side": drawer_side_table,
    "workbench": workbench,
    "pedestal": pedestal_table,
    "double_pedestal": double_pedestal_table,
    "trestle": trestle_table,
    "x_leg": x_leg_table,
    "slab": slab_table,
    "cube": cube_table,
    "sled": sled_table,
    "tripod": tripod_table,
    "sculpted": sculpted_table,
    "c_shape": c_table,
    "pedestal_desk": pedestal_desk,
    "writing_desk": writing_desk,
    "hutch_desk": hutch_desk,
    "l_desk": l_desk,
    "t_leg_desk": t_leg_desk,
    "panel_desk": panel_desk,
    "open_bay_desk": open_bay_desk,
    "counter_desk": counter_desk,
    "drafting": drafting_table,
    "conference": conference_table,
    "ping_pong": ping_pong_table,
}
