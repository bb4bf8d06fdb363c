"""Making the tables on a server, and bringing those of an older kpred up to date."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from sqlalchemy import Connection, text

from kpred.errors import DatabaseError

HEAD = "0003"
_KNOWN = ("0001", "0002", "0003")
_LOCK = 0x4B505244
"""Key of the advisory lock for changes of tables."""


def revision(connection: Connection) -> str | None:
    """Return the revision of the tables, or None without tables."""
    if connection.scalar(text("SELECT to_regclass('kpred.kpred_version')")) is None:
        return None
    found = connection.scalar(text("SELECT version_num FROM kpred.kpred_version"))
    return None if found is None else str(found)


def make_tables(connection: Connection, name: str, created_by: str) -> None:
    """Make all tables in the caller's transaction. Raises DatabaseError where there are some already."""
    with _alone(connection):
        if revision(connection) is not None:
            raise DatabaseError(f"Database {name} exists already; open it, or choose another name.")
        connection.execute(text("CREATE SCHEMA IF NOT EXISTS kpred"))
        _upgrade(connection)
        info = [{"key": "created_by", "value": created_by}, {"key": "schema_version", "value": str(int(HEAD))}]
        connection.execute(text("INSERT INTO kpred.info (key, value) VALUES (:key, :value)"), info)


def is_current(connection: Connection, name: str) -> bool:
    """Say whether the tables are of this format and not of an older one.

    Raises DatabaseError: there are none, or they are newer than this kpred.
    """
    found = revision(connection)
    if found is None:
        raise DatabaseError(f"Database {name} holds no kpred database; make it with 'kpred database build'.")
    if found not in _KNOWN:
        raise DatabaseError(
            f"Database {name} has format {found}, newer than format {HEAD} of this kpred; upgrade kpred."
        )
    return found == HEAD


def check_tables(connection: Connection, name: str) -> None:
    """Raise DatabaseError unless there are tables, of this format."""
    if not is_current(connection, name):
        raise DatabaseError(
            f"Database {name} has format {revision(connection)}, older than format {HEAD} of this kpred; run "
            f"'kpred database update {name}'."
        )


def upgrade_tables(connection: Connection, name: str) -> bool:
    """Bring the tables up to date in the caller's transaction, and say whether they were older.

    The caller adds what their rows lack (`kpred.database.update`). Raises DatabaseError like `is_current`.
    """
    with _alone(connection):
        if is_current(connection, name):
            return False
        _upgrade(connection)
        connection.execute(
            text("UPDATE kpred.info SET value = :value WHERE key = 'schema_version'"), {"value": str(int(HEAD))}
        )
        return True


@contextmanager
def _alone(connection: Connection) -> Iterator[None]:
    """Lock the tables against concurrent migrations; the lock ends with the transaction."""
    connection.execute(text("SELECT pg_advisory_xact_lock(:key)"), {"key": _LOCK})
    yield


def _upgrade(connection: Connection, to: str = "head") -> None:
    from alembic import command
    from alembic.config import Config

    config: Any = Config()
    config.set_main_option("script_location", str(Path(__file__).parent / "migrations"))
    config.attributes["connection"] = connection
    command.upgrade(config, to)
