"""Evaluation: protocols, baselines and the rows that say what was measured.

Names are imported at first use, so that `import kpred.evaluation` loads neither SQLAlchemy nor torch.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from kpred.evaluation.scans.real import evaluate_crops as evaluate_crops
    from kpred.evaluation.scans.real import read_crops as read_crops
    from kpred.evaluation.scans.scans import ScansReport as ScansReport
    from kpred.evaluation.scans.scans import evaluate_scans as evaluate_scans
    from kpred.evaluation.scans.scene_targets import evaluate_scenes as evaluate_scenes
    from kpred.evaluation.tables.rows import Row as Row
    from kpred.evaluation.tables.rows import Score as Score
    from kpred.evaluation.tables.rows import aggregate as aggregate
    from kpred.evaluation.tables.rows import write_rows as write_rows
    from kpred.evaluation.tables.run import evaluate as evaluate
    from kpred.evaluation.tables.run import run_header as run_header
    from kpred.evaluation.tables.table_data import Table as Table
    from kpred.evaluation.tables.table_data import read_table as read_table
    from kpred.evaluation.tables.table_data import write_table as write_table
    from kpred.evaluation.tables.tables import TableConfig as TableConfig
    from kpred.evaluation.tables.tables import make_table as make_table

_HOME = {
    "Row": "tables.rows",
    "ScansReport": "scans.scans",
    "Score": "tables.rows",
    "Table": "tables.table_data",
    "TableConfig": "tables.tables",
    "aggregate": "tables.rows",
    "evaluate": "tables.run",
    "evaluate_crops": "scans.real",
    "evaluate_scans": "scans.scans",
    "evaluate_scenes": "scans.scene_targets",
    "make_table": "tables.tables",
    "read_crops": "scans.real",
    "read_table": "tables.table_data",
    "run_header": "tables.run",
    "write_rows": "tables.rows",
    "write_table": "tables.table_data",
}

__all__ = sorted(_HOME)  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOME])
