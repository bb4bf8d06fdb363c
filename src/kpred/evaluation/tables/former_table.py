"""Series of tables of version 1, whose metrics had one name for surface and distance."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from kpred.evaluation.metrics.metric import FRACTION, MESH, SEEN, UCD, UNIT, WHOLE

_WHOLE_SURFACE = "unilateral_chamfer_distance_of_whole_surface"


def series_of_version_1(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values of a series as this version writes them, so that older tables can be compared."""
    method, order = values["method"].removesuffix("_whole"), ""
    metric, unit = values["distance"], values["unit"]
    surface = SEEN if unit == UNIT else MESH
    if metric == _WHOLE_SURFACE:
        metric, surface = UCD, WHOLE
    if "_by_" in method:
        metric, _, order = method.partition("_by_")
        surface = SEEN
    kept = {key: values[key] for key in ("model", "protocol", "occlusion", "top_k")}
    unit = FRACTION if unit == "share" else unit
    return {**kept, "method": order or method, "metric": metric, "surface": surface, "unit": unit}
