"""Measures of cleanliness: what a deformed mesh lost of its model's flatness, right angles and symmetry."""

from __future__ import annotations

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
    "repetition": LENGTH,
    "dihedral_change": ANGLE,
}
"""Attributes of `kpred.shapes.structure.cleanliness.Cleanliness` and their units."""
