"""Fitting: a scan in, the CAD model that explains it out, in the scan's own place and units."""

from typing import TYPE_CHECKING

from kpred._lazy import lazy_names

if TYPE_CHECKING:
    from kpred.fitting.defaults import bundled_database_path, sample_scan
    from kpred.fitting.pipeline import fit
    from kpred.fitting.result import Candidate, Fit, Metric
    from kpred.refinement.config import RefineConfig
    from kpred.refinement.keypoints import refine_keypoints

__all__ = [
    "Candidate",
    "Fit",
    "Metric",
    "RefineConfig",
    "bundled_database_path",
    "fit",
    "refine_keypoints",
    "sample_scan",
]

_MODULES = {
    "Candidate": "kpred.fitting.result",
    "Fit": "kpred.fitting.result",
    "Metric": "kpred.fitting.result",
    "RefineConfig": "kpred.refinement.config",
    "bundled_database_path": "kpred.fitting.defaults",
    "fit": "kpred.fitting.pipeline",
    "refine_keypoints": "kpred.refinement.keypoints",
    "sample_scan": "kpred.fitting.defaults",
}

__getattr__, __dir__ = lazy_names(__name__, _MODULES)
