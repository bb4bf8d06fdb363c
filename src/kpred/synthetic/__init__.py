"""Seeded parametric furniture: labelled parts, structural families, packs of shapes."""

from kpred.synthetic.generator import FAMILIES, build, generate

__all__ = ["FAMILIES", "build", "generate"]
