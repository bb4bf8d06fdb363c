"""The model and the database of a fit: given, named, or bundled; loaded once and checked against each other."""

from __future__ import annotations

import os
from functools import lru_cache
from importlib import resources
from pathlib import Path

from kpred.database import Database
from kpred.errors import DatabaseError, ScanError
from kpred.nn import Model, load_model


def bundled_database_path() -> Path:
    """The starter database that comes with the package."""
    return Path(str(resources.files("kpred"))) / "bundled" / "furniture.kpred"


def sample_scan() -> Path:
    """The sample scan that comes with the package.

    Raises:
        ScanError: it is missing, as in a damaged installation.
    """
    path = Path(str(resources.files("kpred"))) / "bundled" / "chair_scan.ply"
    if not path.is_file():
        raise ScanError(f"{path}: the bundled sample scan is missing; install kpred again.")
    return path


def as_model(model: Model | str | os.PathLike[str] | None) -> Model:
    """The model itself, or the one of this name or folder (None: bundled), loaded once a process."""
    if isinstance(model, Model):
        return model
    return _loaded_model(None if model is None else str(model))


def as_database(database: Database | str | os.PathLike[str] | None) -> Database:
    """The database itself, or the one at this path (None: bundled), opened once a process."""
    if isinstance(database, Database):
        return database
    return _opened(None if database is None else str(database))


def shared_categories(model: Model, database: Database, category: str | None) -> list[str]:
    """Categories that both know, or the one asked for.

    Raises:
        DatabaseError: if the database was made by other weights, or is empty.
        ModelError: if the model does not know the category.
    """
    _check(model, database)
    if category is not None:
        model[category]
        return [category]
    stored = database.categories()
    shared = [name for name in model.categories if name in stored]
    if not shared:
        raise DatabaseError(f"Database {database.path} holds no models; add some with 'kpred database add'.")
    return shared


@lru_cache(maxsize=4)
def _loaded_model(name: str | None) -> Model:
    return load_model(name)


@lru_cache(maxsize=4)
def _opened(path: str | None) -> Database:
    if path is not None:
        return Database.open(path)
    bundled = bundled_database_path()
    if not bundled.is_file():
        raise DatabaseError(f"The bundled database {bundled} is missing; reinstall kpred or give a database.")
    return Database.open(bundled, read_only=True)


@lru_cache(maxsize=64)
def _check(model: Model, database: Database) -> None:
    # Hashing all weights takes longer than a fit: once for each pair.
    database.check_model(model)
