"""Furniture of Infinigen's factories, made by an environment of its own."""

from kpred.datasets.infinigen.factories import FACTORIES
from kpred.datasets.infinigen.generate import GenerationReport, generate_infinigen

__all__ = ["FACTORIES", "GenerationReport", "generate_infinigen"]
