"""A database on a server of PostgreSQL with pgvector, in the schema `kpred`: many writers, a pool of connections.

Categories of few models are searched in memory, exactly. Of very many models an HNSW index names those that are near
by plain L1, and the exact weighted distance ranks them: some of the nearest may then be missed.
"""

from __future__ import annotations

import os
import re
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np
from sqlalchemy import Connection, Engine, create_engine, text
from sqlalchemy.engine import make_url
from sqlalchemy.exc import ArgumentError, DBAPIError, NoSuchModuleError
from sqlalchemy.exc import TimeoutError as PoolTimeout

from kpred.database.address import masked
from kpred.database.arrays import DamagedArray
from kpred.database.backend import INDEX_FROM, Added, ConnectionLost, Progress
from kpred.database.postgres_schema import check_tables, make_tables, revision
from kpred.database.rows import CategoryTokens, count_tokens, new_epoch, read_tokens
from kpred.database.search import (
    Index,
    Ranking,
    TokenIndex,
    checked_query,
    checked_top_k,
    checked_weights,
    exact_distances,
    nearest,
)
from kpred.errors import ConfigError, DatabaseError

MAX_DIMENSIONS = 2000
"""Numbers of a vector that an HNSW index takes; longer tokens are compared one by one, by the server."""

_PREFETCH = 20
_MIN_PREFETCH = 400
_MAX_PREFETCH = 1000
"""Models that the index names for each one wanted, and at least and at most (`hnsw.ef_search`)."""

_POOL = 5
"""Connections that are kept; as many more are opened when all are in use."""


_PATIENCE = (0.1, 0.3, 1.0, 2.0, 4.0, 8.0)
"""Seconds to wait before each new attempt to connect."""

_STARTING = ("57P01", "57P02", "57P03")
"""What a server says that is stopping or starting."""


def database_exists(address: str | os.PathLike[str], timeout: float = 5.0) -> bool:
    """Test whether there are tables of kpred on the server; raises DatabaseError when it cannot be reached."""
    backend = PostgresBackend(address, read_only=True, timeout=timeout, check=False)
    try:
        with backend.transaction(write=False) as connection:
            return revision(connection) is not None
    finally:
        backend.close()


class PostgresBackend:
    """Connections to one server; threads have one each."""

    one_at_a_time = False

    def __init__(
        self,
        address: str | os.PathLike[str],
        read_only: bool,
        timeout: float,
        create: str | None = None,
        check: bool = True,
        index_from: int = INDEX_FROM,
    ) -> None:
        """Connect, and make the tables (`create`: by which version of kpred) or check that they are up to date.

        Raises:
            ConfigError: psycopg or Alembic is not installed.
            DatabaseError: the address is none, the server cannot be reached, or its tables cannot be used.
        """
        # A path in between has made one slash of two.
        written = re.sub(r"(?i)^postgres(ql)?(\+\w+)?:/+", "postgresql+psycopg://", os.fspath(address))
        try:
            url = make_url(written)
            self.path = masked(written).replace("+psycopg", "", 1)
            if "@" in (url.host or ""):  # Messages of the driver would show what stands before it.
                raise DatabaseError(f"{masked(address)}: the password holds an @; write %40 for it.")
            arguments = {"connect_timeout": max(1, round(timeout))}
            if "options" not in url.query:
                arguments["options"] = "-c search_path=kpred,public"  # type: ignore[assignment]
            self._engine: Engine = create_engine(
                url, pool_size=_POOL, max_overflow=_POOL, pool_pre_ping=True, pool_timeout=30, connect_args=arguments
            )
        except (ArgumentError, ValueError) as error:
            raise DatabaseError(f"{masked(address)} is no address; write postgresql://user@host/name.") from error
        except (ImportError, NoSuchModuleError) as error:
            raise ConfigError("PostgreSQL needs psycopg and Alembic; pip install 'kpred[postgres]'.") from error
        self.read_only = read_only
        self._index_from = index_from
        self._patience: tuple[float, ...] = ()
        try:
            if create is not None:
                with self._connected() as connection:
                    make_tables(connection, self.path, create)
            elif check:
                with self._connected() as connection:
                    check_tables(connection, self.path)
        except BaseException:
            self.close()
            raise

    @contextmanager
    def _connected(self) -> Iterator[Connection]:
        with _explained(self.path):
            connection = self._connect()
            # Only a server that was there once is waited for.
            self._patience = _PATIENCE
            with connection, connection.begin():
                yield connection

    def _connect(self) -> Connection:
        """Open a connection, waiting some seconds for a server that has just gone away."""
        for pause in self._patience:
            try:
                return self._engine.connect()
            except DBAPIError as error:
                if str(getattr(error.orig, "sqlstate", None) or "57P03") not in _STARTING:
                    raise
                time.sleep(pause)
        return self._engine.connect()

    @contextmanager
    def transaction(self, write: bool, exclusive: bool = False) -> Iterator[Connection]:
        """See `Backend`; adds run concurrently, removes lock exclusively because they may delete a category."""
        if write and self.read_only:
            raise DatabaseError(f"Database {self.path} is open for reading only; open it for writing.")
        with self._connected() as connection:
            if write:
                mode = "SHARE ROW EXCLUSIVE" if exclusive else "ROW EXCLUSIVE"
                connection.execute(text(f"LOCK TABLE category IN {mode} MODE"))
            yield connection
            if write:
                # Last, for others who write wait here until this one has committed.
                change = text("UPDATE info SET value = :value WHERE key = 'content'")
                connection.execute(change, {"value": new_epoch()})

    def version(self, connection: Connection) -> object:
        """See `Backend`."""
        return connection.scalar(text("SELECT value FROM info WHERE key = 'content'"))

    def peek_version(self) -> object | None:
        """See `Backend`; a server needs a query."""
        return None

    def bytes(self, connection: Connection) -> int:
        """Return the size of the tables and their indices in bytes."""
        sizes = (
            "SELECT sum(pg_total_relation_size(c.oid)) FROM pg_class c JOIN pg_namespace n ON n.oid = c.relnamespace "
        )
        return int(connection.scalar(text(sizes + "WHERE n.nspname = 'kpred' AND c.relkind = 'r'")) or 0)

    def added(self, connection: Connection, rows: Sequence[Added]) -> None:
        """See `Backend`: the tokens once more, as vectors."""
        values = [
            {"model": row.model, "category": row.category, "tokens": _written(row.tokens.astype(np.float16))}
            for row in rows
        ]
        if values:
            insert = "INSERT INTO embedding VALUES (:model, :category, CAST(:tokens AS vector))"
            connection.execute(text(insert), values)

    def index(self, connection: Connection, category: str, progress: Progress | None = None) -> Index | None:
        """See `Backend`; makes the server's index where it is missing and may be made."""
        counted = count_tokens(connection, category)
        if counted is None:
            return None
        if counted.models < self._index_from:
            return TokenIndex(*read_tokens(connection, counted))
        if counted.keypoints * counted.token_size <= MAX_DIMENSIONS and not self.read_only:
            self.make_index(counted)
        return ServerIndex(self, counted)

    def close(self) -> None:
        """See `Backend`."""
        self._engine.dispose()

    def make_index(self, counted: CategoryTokens) -> None:
        """Make the HNSW index of one category, unless it is there."""
        name = f"embedding_tokens_{counted.number}"
        with self._connected() as connection:
            if connection.scalar(text("SELECT to_regclass(:name)"), {"name": f"kpred.{name}"}) is not None:
                return
            connection.execute(text("SELECT pg_advisory_xact_lock(:key)"), {"key": 0x4B505245})
            size = counted.keypoints * counted.token_size
            connection.execute(
                text(
                    f"CREATE INDEX IF NOT EXISTS {name} ON kpred.embedding USING hnsw "
                    f"((tokens::public.vector({size})) public.vector_l1_ops) WHERE category_id = {counted.number}"
                )
            )


class ServerIndex:
    """One category, searched by the server."""

    def __init__(self, backend: PostgresBackend, counted: CategoryTokens) -> None:
        self._backend, self._counted = backend, counted

    @property
    def model_ids(self) -> tuple[str, ...]:
        """All ids, ascending."""
        query = text("SELECT model_id FROM model WHERE category_id = :number ORDER BY model_id")
        with self._backend.transaction(write=False) as connection:
            return tuple(connection.scalars(query, {"number": self._counted.number}))

    def ranked(self, query: np.ndarray, weights: np.ndarray | None = None, top_k: int = 10) -> Ranking:
        """Find the `top_k` models nearest to `query` (K, C) among those of the server's index; ties by id."""
        counted = self._counted
        query = checked_query(query, (counted.keypoints, counted.token_size))
        weigh = checked_weights(weights, counted.keypoints)
        many = max(checked_top_k(top_k), min(max(_PREFETCH * top_k, _MIN_PREFETCH), _MAX_PREFETCH))
        size = query.size
        with self._backend.transaction(write=False) as connection:
            connection.execute(text(f"SET LOCAL hnsw.ef_search = {min(many, _MAX_PREFETCH)}"))
            connection.execute(text("SET LOCAL hnsw.iterative_scan = relaxed_order"))
            # Numbers stand in the text itself, or the planner would not see that the category's index is meant.
            found = connection.execute(
                text(
                    f"WITH near AS MATERIALIZED (SELECT model FROM embedding WHERE category_id = {counted.number} "
                    f"ORDER BY (tokens::vector({size})) <+> CAST(:query AS vector({size})) LIMIT {many}) "
                    "SELECT m.model_id, d.tokens FROM near JOIN model m ON m.id = near.model "
                    "JOIN descriptor d ON d.model = near.model"
                ),
                {"query": _written(query)},
            ).all()
        tokens = np.frombuffer(b"".join(row.tokens for row in found), "<f2").reshape(len(found), *query.shape)
        return nearest([str(row.model_id) for row in found], exact_distances(tokens, query, weigh), top_k)


def _written(numbers: np.ndarray) -> str:
    """Format a vector as text for pgvector."""
    return f"[{','.join(map(repr, numbers.astype(np.float32).ravel().astype(float).tolist()))}]"


@contextmanager
def _explained(name: str) -> Iterator[None]:
    """Turn errors of the server into a DatabaseError that names it and the mend."""
    try:
        yield
    except DBAPIError as error:
        code = str(getattr(error.orig, "sqlstate", None) or "")
        reason = masked((str(error.orig).splitlines() or [type(error.orig).__name__])[0].strip())
        lost = error.connection_invalidated or code[:2] in ("08", "57")
        if code in _SENTENCES:
            raise DatabaseError(f"Database {name}: {_SENTENCES[code]}") from error
        if lost or (not code and type(error).__name__ == "OperationalError"):
            raise ConnectionLost(
                f"Database {name} cannot be reached ({reason}); check the address, and that the server runs."
            ) from error
        raise DatabaseError(f"Database {name}: {reason}; see the server's log.") from error
    except PoolTimeout as error:
        raise ConnectionLost(f"Database {name}: all connections are in use; use fewer threads.") from error
    except DamagedArray as error:
        raise DatabaseError(f"Database {name}: {error}; an array is damaged, build it again.") from error


_SENTENCES = {
    "28P01": "the password is wrong; give the right one in the address or in ~/.pgpass.",
    "28000": "this user may not connect; ask the server's administrator.",
    "3D000": "there is no database of that name; make it with createdb.",
    "42501": "this user may not do that; ask the server's administrator for the right.",
    "53100": "the server's disk is full; free some space and run the same again, what was committed is kept.",
    "53300": "the server takes no more connections; try again later, or use fewer workers.",
    "25006": "the server is for reading only; give the address of the one that is written.",
    "58P01": "the server has no pgvector; install it there.",
    "0A000": "the server has no pgvector; install it there.",
}
