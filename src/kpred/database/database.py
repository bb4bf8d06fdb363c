"""The CAD database: one file, or tables on a server, searched and fitted from memory."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from sqlalchemy import Connection, func, select

from kpred._version import __version__
from kpred.database.address import is_address
from kpred.database.backend import INDEX_FROM, Backend, Progress, retry_on_disconnect
from kpred.database.cached_reads import CachedReads
from kpred.database.candidates import Candidates, stack_candidates
from kpred.database.connection import create_file
from kpred.database.entry import Entry
from kpred.database.fingerprint import read_fingerprint
from kpred.database.postgres import PostgresBackend, database_exists
from kpred.database.records import ModelRecord, insert_records, make_record, read_records
from kpred.database.rows import (
    chunks,
    delete_rows,
    find_rows,
    read_appearance,
    read_category_names,
    read_entries,
    read_fitting_arrays,
)
from kpred.database.schema import CategoryRow, ModelRow
from kpred.database.search import Index, SearchResult, as_result
from kpred.database.sqlite import SqliteBackend
from kpred.database.statistics import read_metadata, read_statistics
from kpred.database.weights_check import check_weights
from kpred.errors import DatabaseError
from kpred.nn import KPRed
from kpred.shapes.appearance.appearance import Appearance


class Database:
    """CAD models with their keypoints, tokens and deformation bases, in one file or on a server of PostgreSQL.

    Open it with `Database.open` or `Database.create`, close it with `close` or `with`. A place is a file, or an address
    `postgresql://user@host/name`. Every `add` and `remove` is one transaction: it is there whole, or not at all,
    whatever happens to the process. Several processes may read while one writes (on a server, many write at once); what
    another process has written is seen at the next call. An object may be shared by threads. All methods raise
    DatabaseError when the place cannot be read or written.
    """

    def __init__(self, backend: Backend) -> None:
        """Use `open` or `create` instead."""
        self._backend = backend
        self._reads = CachedReads(backend)
        self._cache = self._reads.cache

    @classmethod
    def open(
        cls,
        path: str | os.PathLike[str],
        *,
        read_only: bool | None = None,
        timeout: float = 5.0,
        index_from: int = INDEX_FROM,
    ) -> Database:
        """Open an existing database; read-only if requested, or if the file may not be written.

        `timeout`: seconds to wait while another process writes, before giving up. `index_from`: models of a category
        from which on an index on disk is searched.
        Raises DatabaseError: missing, empty, foreign, damaged, older or newer than this program, locked.
        """
        if is_address(path):
            return cls(PostgresBackend(path, bool(read_only), timeout, index_from=index_from))
        file = Path(path)
        if read_only is None:
            read_only = file.exists() and not os.access(file, os.W_OK)
        return cls(SqliteBackend(file, read_only, timeout, index_from))

    @classmethod
    def create(
        cls,
        path: str | os.PathLike[str],
        *,
        overwrite: bool = False,
        timeout: float = 5.0,
        index_from: int = INDEX_FROM,
    ) -> Database:
        """Make an empty database and open it as `open` does; folders on the way to it are made.

        Raises DatabaseError: it exists already and `overwrite` is not set, or cannot be written.
        """
        if is_address(path):
            return cls(PostgresBackend(path, False, timeout, create=__version__, index_from=index_from))
        file = Path(path)
        if file.exists() and not overwrite:
            raise DatabaseError(f"Database {file} exists already; open it, or choose another name.")
        create_file(file, __version__, overwrite)
        return cls(SqliteBackend(file, False, timeout, index_from))

    @staticmethod
    def exists(path: str | os.PathLike[str]) -> bool:
        """Test whether there is a file, or tables on the server, at this place."""
        return database_exists(path) if is_address(path) else Path(path).exists()

    @property
    def path(self) -> Path | str:
        """The file, or the server's address without its password."""
        return self._backend.path

    @property
    def read_only(self) -> bool:
        """Whether nothing may be written."""
        return self._backend.read_only

    def close(self) -> None:
        """Let go of the file and of the memory; closing twice does nothing."""
        self._reads.close()

    def __enter__(self) -> Database:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def add(self, entries: Iterable[Entry], *, model_name: str = "", replace: bool = False) -> int:
        """Put entries into the file in one transaction and return their number.

        `model_name`: name of the model whose weights made them, for messages; `replace`: models of the same ids go.
        Raises DatabaseError, and then adds none of them: an id is there already, the weights of an entry (its
        `fingerprint`) are not those of the other entries of its category, or its arrays do not fit each other.
        """
        pending = list(entries)
        for entry in pending:
            entry.check()
        return self.add_records([make_record(entry, model_name) for entry in pending], replace=replace)

    def add_records(self, models: Sequence[ModelRecord], *, replace: bool = False) -> int:
        """Put models of another database into this one in one transaction, to the bit; otherwise like `add`."""
        return retry_on_disconnect(lambda is_retry: self._add(models, is_retry, replace))

    def _add(self, models: Sequence[ModelRecord], is_retry: bool, replace: bool) -> int:
        with self._reads.transaction(write=True, exclusive=replace) as connection:
            present = find_rows(connection, [model.model_id for model in models]) if replace or is_retry else {}
            if replace:
                delete_rows(connection, list(present.values()))
            # A connection that was lost while committing leaves open whether it did.
            elif models and len(present) == len(models):
                return len(models)
            self._backend.added(connection, insert_records(connection, models, str(self.path)))
        return len(models)

    def remove(self, model_ids: Iterable[str]) -> int:
        """Take models out of the file in one transaction and return their number.

        A category without models is deleted too, so that other weights may fill it.
        Raises DatabaseError, and then removes none of them: an id is not in the database.
        """
        wanted = list(dict.fromkeys(model_ids))
        with self._reads.transaction(write=True, exclusive=True) as connection:
            rows = find_rows(connection, wanted)
            self._reads.check_known(wanted, rows)
            delete_rows(connection, list(rows.values()))
        return len(wanted)

    def __len__(self) -> int:
        with self._reads.transaction() as connection:
            return int(connection.scalar(select(func.count()).select_from(ModelRow)) or 0)

    def __contains__(self, model_id: object) -> bool:
        with self._reads.transaction() as connection:
            return connection.scalar(select(ModelRow.id).where(ModelRow.model_id == str(model_id))) is not None

    def categories(self) -> tuple[str, ...]:
        """Return the names of categories that have models, sorted."""
        found = self._reads.cached(self._cache.categories, ("",), lambda reader, _: {"": read_category_names(reader)})
        return found[""]

    def fingerprint(self) -> str:
        """Hash the content, as 64 hexadecimal digits; equal for copies, other after every change of a model."""
        found = self._reads.cached(self._cache.fingerprint, ("",), lambda reader, _: {"": read_fingerprint(reader)})
        return found[""]

    def model_ids(self, category: str | None = None) -> tuple[str, ...]:
        """Return the ids of all models, or of one category, sorted."""
        if category is not None:
            return self._index(category).model_ids
        with self._reads.transaction() as connection:
            return tuple(connection.scalars(select(ModelRow.model_id).order_by(ModelRow.model_id)))

    def metadata(self, model_id: str) -> dict[str, str]:
        """Return the metadata of a model (its split, its source) without reading its arrays."""
        with self._reads.transaction() as connection:
            meta = connection.scalar(select(ModelRow.meta).where(ModelRow.model_id == model_id))
        self._reads.check_known([model_id], () if meta is None else (model_id,))
        return dict(meta or {})

    def all_metadata(self, category: str | None = None) -> dict[str, dict[str, Any]]:
        """Return the metadata of all models, or of one category, by id, with `category` and counts; sorted by id."""
        with self._reads.transaction() as connection:
            return read_metadata(connection, category)

    def entry(self, model_id: str) -> Entry:
        """Return all of one model, mesh and vertex basis included."""
        return retry_on_disconnect(
            lambda _: self._reads.cached(self._cache.entries, (model_id,), read_entries)[model_id]
        )

    def appearance(self, model_id: str) -> Appearance | None:
        """Return materials, textures, names and the like of a model's file; None where nothing was kept."""
        with self._reads.transaction() as connection:
            return read_appearance(connection, model_id)

    def records(self, model_ids: Sequence[str]) -> list[ModelRecord]:
        """Return the stored rows of models, in the order of `model_ids`, for `add_records` of another database."""
        with self._reads.transaction() as connection:
            found: dict[str, ModelRecord] = {}
            for chunk in chunks(model_ids):
                found |= read_records(connection, chunk)
        self._reads.check_known(model_ids, found)
        return [found[name] for name in model_ids]

    def candidates(self, category: str, model_ids: Sequence[str] | None = None) -> Candidates:
        """Return keypoints, points and point bases of models of one category (all when None), in the given order.

        Read once, then cached in memory. Raises DatabaseError for ids that are not in the category, and when models
        have different numbers of points.
        """
        wanted = self._index(category).model_ids if model_ids is None else tuple(model_ids)
        if not wanted:
            raise DatabaseError(f"Database {self.path}: no candidates were named; name at least one model.")
        found = self._reads.cached(self._cache.arrays, wanted, read_fitting_arrays)
        return stack_candidates(category, wanted, found, str(self.path))

    def search(
        self, category: str, tokens: np.ndarray, weights: np.ndarray | None = None, top_k: int = 10
    ) -> SearchResult:
        """Find the `top_k` models of `category` nearest to tokens (K, C) by L1, keypoint i weighted by weights[i].

        Exact, but for very many models on a server (`kpred.database.postgres`). Nearest first, ties by id. Fewer
        than `top_k` when the category has fewer models.
        """
        return retry_on_disconnect(lambda _: as_result(self._index(category).ranked(tokens, weights, top_k)))

    def prepare_search(self, progress: Progress | None = None) -> None:
        """Build the search index of each category; with very many models, a token file beside the database.

        `progress`: called with the number done and the total, of the current category.
        """
        for category in self.categories():
            self._index(category, progress)

    def info(self) -> dict[str, Any]:
        """Return path, bytes, format, maker, and per category models, weights and sizes."""
        with self._reads.transaction() as connection:
            size = self._backend.bytes(connection)
            return {"path": str(self.path), "bytes": size, **read_statistics(connection)}

    def check_model(self, model: Mapping[str, KPRed] | KPRed) -> None:
        """Raise DatabaseError when this database was encoded by other weights than those of `model`.

        Categories that only one of the two has are no error, as long as there is one that both have.
        """
        with self._reads.transaction() as connection:
            rows = connection.execute(select(CategoryRow)).all()
        check_weights(rows, model, str(self.path))

    def _index(self, category: str, progress: Progress | None = None) -> Index:
        def read(connection: Connection, _: Sequence[str]) -> dict[str, Index]:
            index = self._backend.index(connection, category, progress)
            if index is None:
                names = ", ".join(read_category_names(connection)) or "none"
                raise DatabaseError(f"Database {self.path} has no models of category {category!r}; it has {names}.")
            return {category: index}

        return self._reads.cached(self._cache.indices, (category,), read)[category]
