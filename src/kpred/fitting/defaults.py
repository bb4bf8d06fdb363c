"""The model and the database of a fit: given, named, or bundled; loaded once and checked against each other."""

from __future__ import annotations

import os
from importlib import resources
from pathlib import Path
from threading import Lock
from weakref import WeakKeyDictionary, WeakSet

from kpred.database import Database
from kpred.database.address import is_address
from kpred.errors import DatabaseError, ScanError
from kpred.fitting.file_cache import FileCache, file_identity, folder_state
from kpred.nn import Model, load_model
from kpred.nn.loading import is_folder_name

LOADED = 4
"""Models, and databases, that are kept in memory for the next fit."""

_models: FileCache[Model] = FileCache(LOADED)
_databases: FileCache[Database] = FileCache(LOADED)

_checked: WeakKeyDictionary[Model, WeakSet[Database]] = WeakKeyDictionary()
"""Databases that were found to be made by a model's weights; neither is kept alive by this."""

_checking = Lock()


def bundled_database_path() -> Path:
    """Return the path of the bundled starter database."""
    return Path(str(resources.files("kpred"))) / "bundled" / "furniture.kpred"


def sample_scan() -> Path:
    """Return the path of the bundled sample scan.

    Raises:
        ScanError: it is missing, as in a damaged installation.
    """
    path = Path(str(resources.files("kpred"))) / "bundled" / "chair_scan.ply"
    if not path.is_file():
        raise ScanError(f"{path}: the bundled sample scan is missing; install kpred again.")
    return path


def resolve_model(model: Model | str | os.PathLike[str] | None) -> Model:
    """Resolve a model: itself, or that of a name or folder (None: bundled), loaded again only when its files change.

    Raises:
        ModelError: it is missing or damaged.
    """
    if isinstance(model, Model):
        return model
    name = None if model is None else str(model)
    if name is None or not is_folder_name(name):
        return _models.get(name, None, lambda: load_model(name))
    folder = Path(os.path.abspath(name))
    return _models.get((name, folder), folder_state(folder), lambda: load_model(name))


def resolve_database(database: Database | str | os.PathLike[str] | None) -> Database:
    """Resolve a database: itself, or that at a path (None: bundled), opened again when another file is there.

    Raises:
        DatabaseError: it is missing or damaged.
    """
    if isinstance(database, Database):
        return database
    if database is None:
        return _databases.get(None, None, _open_bundled)
    if is_address(database):
        return _databases.get(str(database), None, lambda: Database.open(database))
    file = Path(os.path.abspath(database))
    return _databases.get(file, file_identity(file), lambda: Database.open(database))


def shared_categories(model: Model, database: Database, category: str | None) -> list[str]:
    """Return the categories of both model and database, or only the given one.

    Those that the shared recognizer distinguishes are returned alone, without one those with networks of their own.
    Others are searched when they are named, or in a database that holds no such ones.

    Raises:
        DatabaseError: if the database was made by other weights, or is empty.
        ModelError: if the model does not know the category.
    """
    _check(model, database)
    if category is not None:
        model[category]
        return [category]
    stored = database.categories()
    alone = model.categories if model.shared_recognizer is None else model.shared_recognizer.config.categories
    ordered = [*model.categories, *(name for name in stored if name not in model.categories)]
    usable = [name for name in ordered if name in stored and name in model]
    shared = [name for name in usable if name in alone] or usable
    if not shared:
        raise DatabaseError(f"Database {database.path} holds no models; add some with 'kpred database add'.")
    return shared


def _open_bundled() -> Database:
    bundled = bundled_database_path()
    if not bundled.is_file():
        raise DatabaseError(f"The bundled database {bundled} is missing; reinstall kpred or give a database.")
    return Database.open(bundled, read_only=True)


def _check(model: Model, database: Database) -> None:
    # Hashing all weights takes longer than a fit: once for each pair.
    with _checking:
        if database in _checked.get(model, ()):
            return
    database.check_model(model)
    with _checking:
        _checked.setdefault(model, WeakSet()).add(database)
