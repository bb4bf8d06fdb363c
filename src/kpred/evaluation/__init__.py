"""Evaluation: protocols, baselines and the rows that say what was measured.

Names are imported at first use, so that `import kpred.evaluation` loads neither SQLAlchemy nor torch.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from kpred.evaluation.scans.real_crops import evaluate_crops as evaluate_crops
    from kpred.evaluation.scans.real_crops import read_crops as read_crops
    from kpred.evaluation.scans.scenes import evaluate_scenes as evaluate_scenes
    from kpred.evaluation.scans.virtual_scans import ScansReport as ScansReport
    from kpred.evaluation.scans.virtual_scans import evaluate_scans as evaluate_scans
    from kpred.evaluation.tables.make_table import TableConfig as TableConfig
    from kpred.evaluation.tables.make_table import make_table as make_table
    from kpred.evaluation.tables.rows import Row as Row
    from kpred.evaluation.tables.rows import Score as Score
    from kpred.evaluation.tables.rows import aggregate as aggregate
    from kpred.evaluation.tables.rows import write_rows as write_rows
    from kpred.evaluation.tables.run import evaluate as evaluate
    from kpred.evaluation.tables.run import run_header as run_header
    from kpred.evaluation.tables.table import Table as Table
    from kpred.evaluation.tables.table import read_table as read_table
    from kpred.evaluation.tables.table import write_table as write_table

_HOME = {
    "Row": "tables.rows",
    "ScansReport": "scans.virtual_scans",
    "Score": "tables.rows",
    "Table": "tables.table",
    "TableConfig": "tables.make_table",
    "aggregate": "tables.rows",
    "evaluate": "tables.run",
    "evaluate_crops": "scans.real_crops",
    "evaluate_scans": "scans.virtual_scans",
    "evaluate_scenes": "scans.scenes",
    "make_table": "tables.make_table",
    "read_crops": "scans.real_crops",
    "read_table": "tables.table",
    "run_header": "tables.run",
    "write_rows": "tables.rows",
    "write_table": "tables.table",
}

__all__ = sorted(_HOME)  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOME])
