"""Data sets as they lie on disk: what is there, what is missing, and mesh packs made of them."""

from kpred.datasets.check import Check, Issue
from kpred.datasets.dataset import Dataset, ShapeFile
from kpred.datasets.find import KINDS, open_dataset
from kpred.datasets.prepare import Prepared, prepare_dataset

__all__ = ["KINDS", "Check", "Dataset", "Issue", "Prepared", "ShapeFile", "open_dataset", "prepare_dataset"]
