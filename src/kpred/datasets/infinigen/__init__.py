"""Furniture of Infinigen's factories, made by an environment of its own."""

from kpred.datasets.infinigen.generate import FACTORIES, Made, generate_infinigen

__all__ = ["FACTORIES", "Made", "generate_infinigen"]
