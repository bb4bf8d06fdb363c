"""Seeded parametric furniture: labelled parts, structural families, packs of shapes."""
