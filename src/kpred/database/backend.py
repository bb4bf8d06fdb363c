"""Storage of a database: the interface that a SQLite file and a PostgreSQL server share, and its retries."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import NamedTuple, Protocol, TypeVar, runtime_checkable

import numpy as np
from sqlalchemy import Connection

from kpred.database.search import Index
from kpred.errors import DatabaseError
from kpred.ops.typing import Float

ATTEMPTS = 4
"""Number of attempts before a lost connection is reported."""

INDEX_FROM = 20_000
"""Models of a category from which on a token file or the server's index is searched; fewer are read into memory."""

Value = TypeVar("Value")

Progress = Callable[[int, int], None]
"""Called with the number done and the total."""


class ConnectionLost(DatabaseError):
    """The server went away, or has not come back; what was not committed is not there."""


def retry_on_disconnect(work: Callable[[bool], Value]) -> Value:
    """Call `work(is_retry)`, again after each lost connection, and return its result.

    Raises ConnectionLost after `ATTEMPTS` attempts.
    """
    for attempt in range(ATTEMPTS):
        try:
            return work(attempt > 0)
        except ConnectionLost:
            if attempt == ATTEMPTS - 1:
                raise
    raise AssertionError("unreachable")


class Added(NamedTuple):
    """An inserted model: its row, its category's row, its tokens (K, C)."""

    model: int
    category: int
    tokens: Float[np.ndarray, "keypoints token_size"]


@runtime_checkable
class Backend(Protocol):
    """Storage of one `Database`.

    Attributes:
        path: the file, or the server's address without its password.
        read_only: whether writing is refused.
        one_at_a_time: whether all threads share one connection and must wait for each other.
    """

    @property
    def path(self) -> Path | str: ...

    @property
    def read_only(self) -> bool: ...

    @property
    def one_at_a_time(self) -> bool: ...

    def transaction(self, write: bool, exclusive: bool = False) -> AbstractContextManager[Connection]:
        """Open a transaction that ends with the block; errors in it become a DatabaseError that names the path.

        `exclusive`: block all other writers meanwhile.
        """
        ...

    def added(self, connection: Connection, rows: Sequence[Added]) -> None:
        """Update search structures for models inserted in this transaction."""
        ...

    def version(self, connection: Connection) -> object:
        """Return a value that changes whenever another connection has written."""
        ...

    def peek_version(self) -> object | None:
        """Return `version` without a transaction, or None where that is not possible quickly."""
        ...

    def index(self, connection: Connection, category: str, progress: Progress | None = None) -> Index | None:
        """Return the search index of a category, or None when there is no such category."""
        ...

    def bytes(self, connection: Connection) -> int:
        """Return the size of the stored data in bytes."""
        ...

    def close(self) -> None:
        """Close connections and release memory."""
        ...
