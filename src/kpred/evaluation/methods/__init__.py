"""Methods on one bench: whatever retrieves database shapes for a target and deforms them is measured alike."""

from kpred.evaluation.methods.bench import Instance, evaluate_methods
from kpred.evaluation.methods.learned import KpRedMethod
from kpred.evaluation.methods.method import Explanation, Method, Searcher
from kpred.evaluation.methods.sources import Sources
from kpred.evaluation.methods.unlearned import NoLearningMethod, UndeformedMethod

__all__ = [
    "Explanation",
    "Instance",
    "KpRedMethod",
    "Method",
    "NoLearningMethod",
    "Searcher",
    "Sources",
    "UndeformedMethod",
    "evaluate_methods",
]
