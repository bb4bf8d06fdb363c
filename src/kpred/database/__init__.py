"""The CAD database: entries, the file that holds them, exact search, and building it from meshes.

Names are imported at first use, so that `import kpred.database` loads neither SQLAlchemy nor torch.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from kpred._lazy import lazy_names

if TYPE_CHECKING:
    from kpred.database.build import BuildReport as BuildReport
    from kpred.database.build import build_database as build_database
    from kpred.database.candidates import Candidates as Candidates
    from kpred.database.copy import CopyReport as CopyReport
    from kpred.database.copy import copy_database as copy_database
    from kpred.database.database import Database as Database
    from kpred.database.encode import deformation_basis as deformation_basis
    from kpred.database.encode import encode_models as encode_models
    from kpred.database.entry import Entry as Entry
    from kpred.database.search import SearchResult as SearchResult
    from kpred.database.update import update_database as update_database

_MODULES = {
    "BuildReport": "build",
    "CopyReport": "copy",
    "copy_database": "copy",
    "Candidates": "candidates",
    "Database": "database",
    "Entry": "entry",
    "SearchResult": "search",
    "build_database": "build",
    "deformation_basis": "encode",
    "encode_models": "encode",
    "update_database": "update",
}

__all__ = sorted(_MODULES)  # pyright: ignore[reportUnsupportedDunderAll]

__getattr__, __dir__ = lazy_names(__name__, _MODULES)
