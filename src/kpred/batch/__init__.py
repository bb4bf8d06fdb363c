"""Fitting very many scans: on this machine or on a cluster, resumed after any interruption.

Names are imported at first use.
"""

from typing import TYPE_CHECKING

from kpred._lazy import lazy_names

if TYPE_CHECKING:
    from kpred.batch.run import BatchReport, fit_many
    from kpred.batch.worker import BatchSettings

__all__ = ["BatchReport", "BatchSettings", "fit_many"]

_MODULES = {"BatchReport": "run", "BatchSettings": "worker", "fit_many": "run"}

__getattr__, __dir__ = lazy_names(__name__, _MODULES)
