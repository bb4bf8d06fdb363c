"""Where a database lives: what differs between a file of SQLite and a server of PostgreSQL."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Protocol, runtime_checkable

from sqlalchemy import Connection

from kpred.database.search import Index

Progress = Callable[[int, int], None]
"""Called with what is done and what there is to do in all."""


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

    def transaction(self, write: bool) -> AbstractContextManager[Connection]:
        """A transaction that ends with the block; what goes wrong in it is a DatabaseError that names the place."""
        ...

    def version(self, connection: Connection) -> object:
        """A value that changes whenever somebody else has written."""
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
