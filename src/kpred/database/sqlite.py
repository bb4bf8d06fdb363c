"""A database in one SQLite file; categories of very many models have a token file beside it (`name.tokens-1`)."""

from __future__ import annotations

import sqlite3
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from sqlalchemy import Connection

from kpred.database.backend import INDEX_FROM, Added, Progress
from kpred.database.connection import explained, open_file
from kpred.database.rows import CategoryTokens, count_tokens, read_epoch, read_tokens, stream_tokens
from kpred.database.search import Index, TokenIndex
from kpred.database.token_file import Rows, make_table, open_table
from kpred.database.token_table import GrowingIndex, TableKey, TokenTable
from kpred.errors import DatabaseError, OutputError

_GROWTH = 8
"""A table is made anew when more than one model for every so many has been added since."""


class SqliteBackend:
    """One connection to one file, shared by threads in turn."""

    one_at_a_time = True

    def __init__(self, path: Path, read_only: bool, timeout: float, index_from: int = INDEX_FROM) -> None:
        """Open the file; raises DatabaseError when it is no database that can be read."""
        self.path = path
        self.read_only = read_only
        self._index_from = index_from
        self._engine = open_file(path, read_only, timeout)
        with self._engine.connect() as connection:  # the only one there is
            self._driver: sqlite3.Connection = connection.connection.driver_connection  # type: ignore[assignment]
        self._tables: dict[str, TokenTable] = {}

    @contextmanager
    def transaction(self, write: bool, exclusive: bool = False) -> Iterator[Connection]:
        """See `Backend`."""
        if write and self.read_only:
            raise DatabaseError(
                f"Database {self.path} is open for reading only; copy it to a place where you may write."
            )
        with (
            explained(self.path),
            self._engine.connect().execution_options(kpred_write=write) as connection,
            connection.begin(),
        ):
            yield connection

    def added(self, connection: Connection, rows: Sequence[Added]) -> None:
        """See `Backend`; a token file is extended when it is next used."""

    def version(self, connection: Connection) -> object:
        """See `Backend`."""
        return connection.exec_driver_sql("PRAGMA data_version").scalar_one()

    def peek_version(self) -> object | None:
        """See `Backend`."""
        try:
            return self._driver.execute("PRAGMA data_version").fetchone()[0]
        except sqlite3.Error:  # the next transaction raises the error
            return None

    def bytes(self, connection: Connection) -> int:
        """Return the size of the file in bytes."""
        return self.path.stat().st_size

    def index(self, connection: Connection, category: str, progress: Progress | None = None) -> Index | None:
        """See `Backend`; makes the token file where it is missing or does not belong to the database."""
        counted = count_tokens(connection, category)
        if counted is None:
            return None
        epoch = read_epoch(connection)
        if counted.models < self._index_from or epoch is None:
            return TokenIndex(*read_tokens(connection, counted))
        table = self._table(connection, counted, epoch, progress)
        later = counted.models - len(table)
        self._tables[category] = table
        tail = TokenIndex(*read_tokens(connection, counted, after=table.key.last_row)) if later else None
        return GrowingIndex(table, tail)

    def close(self) -> None:
        """See `Backend`."""
        self._tables.clear()
        self._engine.dispose()

    def _table(
        self, connection: Connection, counted: CategoryTokens, epoch: str, progress: Progress | None
    ) -> TokenTable:
        file = self.path.with_name(f"{self.path.name}.tokens-{counted.number}")
        for table in (self._tables.get(counted.category), open_table(file)):
            if table is not None and _belongs(table, counted, epoch):
                return table
        self._tables.pop(counted.category, None)
        key = TableKey(counted.category, counted.fingerprint, epoch, counted.last_row)
        shape = (counted.models, counted.keypoints, counted.token_size)

        def report(done: int) -> None:
            if progress is not None:
                progress(done, 2 * counted.models)

        def rows() -> Rows:
            return stream_tokens(connection, counted)

        try:
            return make_table(file, key, shape, rows(), report)
        except OutputError as error:
            warnings.warn(f"{error} Until then the tokens of {self.path} are kept in memory.", stacklevel=2)
            return make_table(None, key, shape, rows(), report)


def _belongs(table: TokenTable, counted: CategoryTokens, epoch: str) -> bool:
    """Test whether a table holds the category's current models, except for a few later ones."""
    key = table.key
    if (key.category, key.fingerprint, key.epoch) != (counted.category, counted.fingerprint, epoch):
        return False
    later = counted.models - len(table)
    return table.half.shape[1:] == (counted.keypoints, counted.token_size) and 0 <= later * _GROWTH <= len(table)
