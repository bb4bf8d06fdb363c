"""The CAD database: one file, or tables on a server, searched and fitted from memory."""

from __future__ import annotations

import os
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from pathlib import Path
from threading import RLock
from types import TracebackType
from typing import Any

import numpy as np
from sqlalchemy import Connection, func, select

from kpred import __version__
from kpred.database.address import is_address
from kpred.database.backend import Home, Progress
from kpred.database.cache import Kept
from kpred.database.candidates import Candidates, stacked
from kpred.database.connection import create_file
from kpred.database.entry import Entry
from kpred.database.postgres import PostgresHome, database_exists
from kpred.database.records import StoredModel, insert_stored, read_stored, stored
from kpred.database.retry import steadily
from kpred.database.rows import FittingArrays, chunks, delete_rows, find_rows, read_entry, read_fitting_arrays
from kpred.database.schema import CategoryRow, ModelRow
from kpred.database.search import Index, SearchResult, as_result
from kpred.database.sqlite import SqliteHome
from kpred.database.statistics import facts
from kpred.database.weights_check import check_weights
from kpred.errors import DatabaseError
from kpred.nn import KPRed


class Database:
    """CAD models with their keypoints, tokens and deformation bases, in one file or on a server of PostgreSQL.

    Open it with `Database.open` or `Database.create`, close it with `close` or `with`. A place is a file, or an address
    `postgresql://user@host/name`. Every `add` and `remove` is one transaction: it is there whole, or not at all,
    whatever happens to the process. Several processes may read while one writes (on a server, many write at once); what
    another process has written is seen at the next call. An object may be shared by threads. All methods raise
    DatabaseError when the place cannot be read or written.
    """

    def __init__(self, home: Home) -> None:
        """Use `open` or `create` instead."""
        self._home = home
        self._open = True
        self._lock = RLock()
        self._kept = Kept()

    @classmethod
    def open(cls, path: str | os.PathLike[str], *, read_only: bool | None = None, timeout: float = 5.0) -> Database:
        """Open an existing database; for reading only when asked, or when the file may not be written.

        `timeout`: seconds to wait while another process writes, before giving up.
        Raises DatabaseError: missing, empty, foreign, damaged, older or newer than this program, locked.
        """
        if is_address(path):
            return cls(PostgresHome(path, bool(read_only), timeout))
        file = Path(path)
        if read_only is None:
            read_only = file.exists() and not os.access(file, os.W_OK)
        return cls(SqliteHome(file, read_only, timeout))

    @classmethod
    def create(cls, path: str | os.PathLike[str], *, overwrite: bool = False, timeout: float = 5.0) -> Database:
        """Make an empty database and open it; folders on the way to it are made.

        Raises DatabaseError: it exists already and `overwrite` is not set, or cannot be written.
        """
        if is_address(path):
            return cls(PostgresHome(path, False, timeout, create=__version__))
        file = Path(path)
        if file.exists() and not overwrite:
            raise DatabaseError(f"Database {file} exists already; open it, or choose another name.")
        create_file(file, __version__)
        return cls(SqliteHome(file, False, timeout))

    @staticmethod
    def exists(path: str | os.PathLike[str]) -> bool:
        """Whether there is a file, or tables on the server, at this place."""
        return database_exists(path) if is_address(path) else Path(path).exists()

    @property
    def path(self) -> Path | str:
        """The file, or the server's address without its password."""
        return self._home.path

    @property
    def read_only(self) -> bool:
        """Whether nothing may be written."""
        return self._home.read_only

    def close(self) -> None:
        """Let go of the file and of the memory; closing twice does nothing."""
        with self._lock:
            self._open = False
            self._kept.forget()
            self._home.close()

    def __enter__(self) -> Database:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    # Writing

    def add(self, entries: Iterable[Entry], *, model_name: str = "") -> int:
        """Put entries into the file in one transaction and return their number.

        `model_name`: name of the model whose weights made them, for messages.
        Raises DatabaseError, and then adds none of them: an id is there already, the weights of an entry (its
        `fingerprint`) are not those of the other entries of its category, or its arrays do not fit each other.
        """
        pending = list(entries)
        for entry in pending:
            entry.check()
        return self.add_stored([stored(entry, model_name) for entry in pending])

    def add_stored(self, models: Sequence[StoredModel]) -> int:
        """Put models of another database into this one in one transaction, to the bit; otherwise like `add`."""
        return steadily(lambda lost: self._add(models, lost))

    def _add(self, models: Sequence[StoredModel], lost: bool) -> int:
        with self._transaction(write=True) as connection:
            # A connection that was lost while committing leaves open whether it did.
            if lost and models and len(find_rows(connection, [model.model_id for model in models])) == len(models):
                return len(models)
            added = []
            for model in models:
                try:
                    added.append(insert_stored(connection, model))
                except DatabaseError as error:
                    raise DatabaseError(f"Database {self.path}: {error}") from error
            self._home.added(connection, added)
        return len(models)

    def remove(self, model_ids: Iterable[str]) -> int:
        """Take models out of the file in one transaction and return their number.

        A category whose last model goes is forgotten, so that it can be filled by other weights.
        Raises DatabaseError, and then removes none of them: an id is not in the database.
        """
        wanted = list(dict.fromkeys(model_ids))
        with self._transaction(write=True, alone=True) as connection:
            rows = find_rows(connection, wanted)
            if len(rows) < len(wanted):
                raise self._unknown([name for name in wanted if name not in rows])
            delete_rows(connection, list(rows.values()))
        return len(wanted)

    # Reading

    def __len__(self) -> int:
        with self._transaction() as connection:
            return int(connection.scalar(select(func.count()).select_from(ModelRow)) or 0)

    def __contains__(self, model_id: object) -> bool:
        with self._transaction() as connection:
            return connection.scalar(select(ModelRow.id).where(ModelRow.model_id == str(model_id))) is not None

    def categories(self) -> tuple[str, ...]:
        """Names of the categories that have models, in alphabetical order."""
        with self._up_to_date() as kept:
            if kept is not None and kept.categories is not None:
                return kept.categories
        with self._transaction() as connection:
            version = self._kept.version
            names = tuple(connection.scalars(select(CategoryRow.name).order_by(CategoryRow.name)))
            if version == self._kept.version:
                self._kept.categories = names
            return names

    def model_ids(self, category: str | None = None) -> tuple[str, ...]:
        """Ids of all models, or of those of one category, in alphabetical order."""
        if category is not None:
            return self._index(category).model_ids
        with self._transaction() as connection:
            return tuple(connection.scalars(select(ModelRow.model_id).order_by(ModelRow.model_id)))

    def metadata(self, model_id: str) -> dict[str, str]:
        """What was recorded about a model (its split, its source) without reading its arrays."""
        with self._transaction() as connection:
            meta = connection.scalar(select(ModelRow.meta).where(ModelRow.model_id == model_id))
        if meta is None:
            raise self._unknown([model_id])
        return dict(meta)

    def entry(self, model_id: str) -> Entry:
        """All of one model, mesh and vertex basis included."""
        entry = steadily(lambda _: self._read_entry(model_id))
        if entry is None:
            raise self._unknown([model_id])
        return entry

    def stored(self, model_ids: Sequence[str]) -> list[StoredModel]:
        """All that is stored of models, in the order of `model_ids`, for another database to take over."""
        with self._transaction() as connection:
            found: dict[str, StoredModel] = {}
            for chunk in chunks(model_ids):
                found |= read_stored(connection, chunk)
        if len(found) < len(set(model_ids)):
            raise self._unknown([name for name in model_ids if name not in found])
        return [found[name] for name in model_ids]

    def candidates(self, category: str, model_ids: Sequence[str] | None = None) -> Candidates:
        """Keypoints, points and point bases of models of one category (all when None), in the order of `model_ids`.

        Read from the file once, then kept in memory. Raises DatabaseError for ids that are not in the category, and
        when models were stored with different numbers of points.
        """
        wanted = self._index(category).model_ids if model_ids is None else tuple(model_ids)
        if not wanted:
            raise DatabaseError(f"Database {self.path}: no candidates were asked for; name at least one model.")
        with self._up_to_date() as kept:
            if kept is not None and kept.has_arrays(wanted):
                return stacked(category, wanted, kept.arrays.get(wanted), str(self.path))
        with self._transaction() as connection:  # which forgets what is out of date
            found = self._kept.arrays.get(wanted)
            missing = [name for name in dict.fromkeys(wanted) if name not in found]
            found |= self._read_candidates(connection, missing)
        return stacked(category, wanted, found, str(self.path))

    def search(
        self, category: str, tokens: np.ndarray, weights: np.ndarray | None = None, top_k: int = 10
    ) -> SearchResult:
        """The `top_k` models of `category` nearest to query tokens (K, C) by L1, keypoint i weighing weights[i].

        Exact, but for very many models on a server (`kpred.database.postgres`). Nearest first, ties by id. Fewer
        than `top_k` when the category has fewer models.
        """
        return steadily(lambda _: as_result(self._index(category).ranked(tokens, weights, top_k)))

    def prepare_search(self, progress: Progress | None = None) -> None:
        """Make what the first search of each category would make: for very many models, a token file beside the file.

        `progress`: called with what is done and what there is to do in all, of the category at hand.
        """
        for category in self.categories():
            self._index(category, progress)

    def info(self) -> dict[str, Any]:
        """Facts for people and programs: path, bytes, format, maker, and per category models, weights and sizes."""
        with self._transaction() as connection:
            size = self._home.bytes(connection)
            return {"path": str(self.path), "bytes": size, **facts(connection)}

    def check_model(self, model: Mapping[str, KPRed] | KPRed) -> None:
        """Raise DatabaseError when other weights made this database than those of `model`.

        Categories that only one of the two has are no error, as long as there is one that both have.
        """
        with self._transaction() as connection:
            rows = connection.execute(select(CategoryRow)).all()
        check_weights(rows, model, str(self.path))

    # Private

    @contextmanager
    def _transaction(self, write: bool = False, alone: bool = False) -> Iterator[Connection]:
        with self._lock if self._home.one_at_a_time else nullcontext():
            if not self._open:
                raise DatabaseError(f"Database {self.path} is closed; open it again.")
            with self._home.transaction(write, alone) as connection:
                version = self._home.version(connection)
                if version != self._kept.version:
                    self._forget()  # another process has written
                    self._kept.version = version
                try:
                    yield connection
                finally:
                    if write:
                        self._forget()

    def _forget(self) -> None:
        with self._lock:
            self._kept.forget()

    @contextmanager
    def _up_to_date(self) -> Iterator[Kept | None]:
        """What is kept in memory, if it is up to date as far as can be told without a transaction."""
        with self._lock:
            version = self._kept.version
            yield self._kept if self._open and version is not None and self._home.glance() == version else None

    def _index(self, category: str, progress: Progress | None = None) -> Index:
        with self._up_to_date() as kept:
            if kept is not None and category in kept.indices:
                return kept.indices[category]
        with self._transaction() as connection:
            version = self._kept.version
            index = self._kept.indices.get(category) or self._home.index(connection, category, progress)
            if index is None:
                names = connection.scalars(select(CategoryRow.name).order_by(CategoryRow.name)).all()
                raise DatabaseError(
                    f"Database {self.path} has no models of category {category!r}; it has {', '.join(names) or 'none'}."
                )
            if version == self._kept.version:
                self._kept.indices[category] = index
            return index

    def _read_entry(self, model_id: str) -> Entry | None:
        with self._up_to_date() as kept:
            entry = None if kept is None else kept.entry(model_id)
            if entry is not None:
                return entry
        with self._transaction() as connection:  # which forgets what is out of date
            version = self._kept.version
            entry = self._kept.entry(model_id)
            if entry is None:
                entry = read_entry(connection, model_id)
                if entry is not None and version == self._kept.version:
                    self._kept.put_entry(entry)
            return entry

    def _read_candidates(self, connection: Connection, model_ids: list[str]) -> dict[str, FittingArrays]:
        version = self._kept.version
        found = read_fitting_arrays(connection, model_ids)
        if len(found) < len(model_ids):
            raise self._unknown([name for name in model_ids if name not in found])
        if version == self._kept.version:  # else another thread has seen that somebody wrote meanwhile
            self._kept.arrays.put(found)
        return found

    def _unknown(self, model_ids: Collection[str]) -> DatabaseError:
        name = sorted(model_ids)[0]
        return DatabaseError(f"Database {self.path} has no model {name!r}; 'kpred database info' tells what it holds.")
