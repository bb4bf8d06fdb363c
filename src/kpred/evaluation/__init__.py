"""Evaluation: methods, metrics and the tables that hold what was measured.

Names are imported at first use, so that `import kpred.evaluation` loads neither SQLAlchemy nor torch.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from kpred._lazy import lazy_names

if TYPE_CHECKING:
    from kpred.evaluation.methods.method import Method as Method
    from kpred.evaluation.methods.method import Prediction as Prediction
    from kpred.evaluation.methods.method import Query as Query
    from kpred.evaluation.metrics.metric import Metric as Metric
    from kpred.evaluation.scans.real_crops import evaluate_crops as evaluate_crops
    from kpred.evaluation.scans.real_crops import read_crops as read_crops
    from kpred.evaluation.scans.scenes import evaluate_scenes as evaluate_scenes
    from kpred.evaluation.scans.virtual_scans import ScansReport as ScansReport
    from kpred.evaluation.scans.virtual_scans import evaluate_scans as evaluate_scans
    from kpred.evaluation.tables.compare import compare as compare
    from kpred.evaluation.tables.config import TableConfig as TableConfig
    from kpred.evaluation.tables.make_table import make_table as make_table
    from kpred.evaluation.tables.table import Series as Series
    from kpred.evaluation.tables.table import Table as Table
    from kpred.evaluation.tables.table import read_table as read_table
    from kpred.evaluation.tables.table import write_table as write_table

_MODULES = {
    "Method": "methods.method",
    "Metric": "metrics.metric",
    "Prediction": "methods.method",
    "Query": "methods.method",
    "ScansReport": "scans.virtual_scans",
    "Series": "tables.table",
    "Table": "tables.table",
    "TableConfig": "tables.config",
    "compare": "tables.compare",
    "evaluate_crops": "scans.real_crops",
    "evaluate_scans": "scans.virtual_scans",
    "evaluate_scenes": "scans.scenes",
    "make_table": "tables.make_table",
    "read_crops": "scans.real_crops",
    "read_table": "tables.table",
    "write_table": "tables.table",
}

__all__ = sorted(_MODULES)  # pyright: ignore[reportUnsupportedDunderAll]

__getattr__, __dir__ = lazy_names(__name__, _MODULES)
