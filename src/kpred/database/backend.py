"""Where a database lives: what differs between a file of SQLite and a server of PostgreSQL."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
from sqlalchemy import Connection

from kpred.database.search import Index

Progress = Callable[[int, int], None]
"""Called with what is done and what there is to do in all."""


class Added(NamedTuple):
    """A model that was just put into the tables: its row, its category's row, its tokens (K, C)."""

    model: int
    category: int
    tokens: np.ndarray


@runtime_checkable
class Home(Protocol):
    """What `Database` asks of the place it lives in.

    Attributes:
        path: the file, or the server's address without its password.
        read_only: nothing may be written.
        one_at_a_time: all threads share one connection, and take turns.
    """

    @property
    def path(self) -> Path | str: ...

    @property
    def read_only(self) -> bool: ...

    @property
    def one_at_a_time(self) -> bool: ...

    def transaction(self, write: bool, alone: bool = False) -> AbstractContextManager[Connection]:
        """A transaction that ends with the block; what goes wrong in it is a DatabaseError that names the place.

        `alone`: nobody else may write meanwhile.
        """
        ...

    def added(self, connection: Connection, rows: Sequence[Added]) -> None:
        """Told of models that were put into the tables in this transaction."""
        ...

    def version(self, connection: Connection) -> object:
        """A value that changes whenever somebody else has written."""
        ...

    def glance(self) -> object | None:
        """What `version` would say, without a transaction; None where it cannot be told quickly."""
        ...

    def index(self, connection: Connection, category: str, progress: Progress | None = None) -> Index | None:
        """What the models of a category are searched by, or None when there is no such category."""
        ...

    def bytes(self, connection: Connection) -> int:
        """How large all is together."""
        ...

    def close(self) -> None:
        """Let go of connections and memory."""
        ...
