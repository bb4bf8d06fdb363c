"""Cleanliness of results as scores: what a deformed mesh lost of its model's flatness, right angles and symmetry."""

from __future__ import annotations

from kpred.evaluation.tables.rows import Score
from kpred.shapes.structure.cleanliness import Cleanliness

LENGTH, ANGLE, FACES = "longest side", "degrees", "faces"

MEASURES = {
    "flatness": LENGTH,
    "straightness": LENGTH,
    "squareness": ANGLE,
    "squareness_95": ANGLE,
    "parallelism": ANGLE,
    "axis_tilt": ANGLE,
    "axis_tilt_95": ANGLE,
    "mirror": LENGTH,
    "part_box": LENGTH,
    "part_shear": ANGLE,
    "contact_gap": LENGTH,
    "contact_gap_95": LENGTH,
    "folded_faces": FACES,
    "dihedral_change": ANGLE,
}
"""Attributes of `kpred.shapes.structure.cleanliness.Cleanliness` and their units."""


def cleanliness_scores(
    found: Cleanliness, protocol: str, occlusion: float, metric: str, top_k: int | None
) -> list[Score]:
    """List one score for each measure that the model has; a model without symmetry has no `mirror`."""
    values = found.to_json()
    return [
        Score(protocol, occlusion, metric, name, top_k, float(value), unit)
        for name, unit in MEASURES.items()
        if (value := values[name]) is not None
    ]
