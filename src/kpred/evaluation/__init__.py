"""Evaluation: protocols, baselines and the rows that say what was measured.

Names are imported at first use, so that `import kpred.evaluation` loads neither SQLAlchemy nor torch.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from kpred.evaluation.real import evaluate_crops as evaluate_crops
    from kpred.evaluation.real import read_crops as read_crops
    from kpred.evaluation.rows import Row as Row
    from kpred.evaluation.rows import Score as Score
    from kpred.evaluation.rows import aggregate as aggregate
    from kpred.evaluation.rows import write_rows as write_rows
    from kpred.evaluation.run import evaluate as evaluate
    from kpred.evaluation.run import run_header as run_header
    from kpred.evaluation.scans import ScansReport as ScansReport
    from kpred.evaluation.scans import evaluate_scans as evaluate_scans
    from kpred.evaluation.scene_targets import evaluate_scenes as evaluate_scenes
    from kpred.evaluation.table_data import Table as Table
    from kpred.evaluation.table_data import read_table as read_table
    from kpred.evaluation.table_data import write_table as write_table
    from kpred.evaluation.tables import TableConfig as TableConfig
    from kpred.evaluation.tables import make_table as make_table

_HOME = {
    "Row": "rows",
    "ScansReport": "scans",
    "Score": "rows",
    "Table": "table_data",
    "TableConfig": "tables",
    "aggregate": "rows",
    "evaluate": "run",
    "evaluate_crops": "real",
    "evaluate_scans": "scans",
    "evaluate_scenes": "scene_targets",
    "make_table": "tables",
    "read_crops": "real",
    "read_table": "table_data",
    "run_header": "run",
    "write_rows": "rows",
    "write_table": "table_data",
}

__all__ = sorted(_HOME)  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOME])
