"""Exports: fitted furniture as files of other tools; one format a file, `format_table` lists them.

Names are imported at first use.
"""

from typing import TYPE_CHECKING

from kpred._lazy import lazy_names

if TYPE_CHECKING:
    from kpred.exports.format_table import EXTENSIONS, check_extension
    from kpred.exports.formats import export_writers, save_export
    from kpred.exports.furniture import Export, Furniture

__all__ = ["EXTENSIONS", "Export", "Furniture", "check_extension", "export_writers", "save_export"]

_MODULES = {
    "EXTENSIONS": "kpred.exports.format_table",
    "Export": "kpred.exports.furniture",
    "Furniture": "kpred.exports.furniture",
    "check_extension": "kpred.exports.format_table",
    "export_writers": "kpred.exports.formats",
    "save_export": "kpred.exports.formats",
}

__getattr__, __dir__ = lazy_names(__name__, _MODULES)
