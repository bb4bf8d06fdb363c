"""Fitting very many scans: on this machine or on a cluster, resumed after any interruption.

Names are imported at first use.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from kpred.batch.run import BatchReport, fit_many
    from kpred.batch.worker import BatchSettings

__all__ = ["BatchReport", "BatchSettings", "fit_many"]

_MODULES = {"BatchReport": "run", "BatchSettings": "worker", "fit_many": "run"}


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module 'kpred.batch' has no attribute {name!r}")
    return getattr(import_module(f"kpred.batch.{_MODULES[name]}"), name)
