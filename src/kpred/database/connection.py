"""Opening a database file, and what its errors mean to the user."""

from __future__ import annotations

import os
import shutil
import sqlite3
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from sqlalchemy import Connection, Engine, StaticPool, create_engine, event
from sqlalchemy.exc import DBAPIError

from kpred.database.arrays import DamagedArray
from kpred.database.rows import new_epoch
from kpred.database.schema import APPLICATION_ID, SCHEMA_VERSION, Base, InfoRow
from kpred.errors import DatabaseError

OLDEST = 2
"""The oldest format that `update_database` brings up to date."""

_ABANDONED = 86_400.0
"""Seconds."""

_MAGIC = b"SQLite format 3\0"


def create_file(path: Path, created_by: str, overwrite: bool = False) -> None:
    """Create an empty database with all tables at `path`, atomically; an existing file stays unless `overwrite`."""
    with explained(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        remove_abandoned(path.parent)
        with tempfile.TemporaryDirectory(prefix=".kpred-", dir=path.parent) as folder:
            temporary = Path(folder) / path.name
            engine = create_engine("sqlite://", creator=lambda: sqlite3.connect(temporary), poolclass=StaticPool)
            try:
                with engine.begin() as connection:
                    # Small pages: every array ends in a page of its own, half empty on average.
                    connection.exec_driver_sql("PRAGMA page_size = 1024")
                    connection.exec_driver_sql(f"PRAGMA application_id = {APPLICATION_ID}")
                    connection.exec_driver_sql(f"PRAGMA user_version = {SCHEMA_VERSION}")
                    Base.metadata.create_all(connection)
                    info = {"schema_version": str(SCHEMA_VERSION), "created_by": created_by, "epoch": new_epoch()}
                    rows = [{"key": key, "value": value} for key, value in info.items()]
                    connection.execute(InfoRow.__table__.insert(), rows)  # type: ignore[attr-defined]
            finally:
                engine.dispose()
            if overwrite:
                os.replace(temporary, path)
            else:
                _place(temporary, path)


def _place(temporary: Path, path: Path) -> None:
    """Give a file its name, unless another process has made a file of that name. Raises DatabaseError."""
    try:
        os.link(temporary, path)
    except FileExistsError as error:
        raise DatabaseError(f"Database {path} exists already; open it, or choose another name.") from error
    except OSError:  # a file system without links
        os.replace(temporary, path)


def remove_abandoned(folder: Path) -> None:
    """Remove folders of unfinished databases that are unchanged for a day: a killed process left them."""
    for item in folder.glob(".kpred-*"):
        try:
            if item.is_dir() and not item.is_symlink() and time.time() - item.stat().st_mtime > _ABANDONED:
                shutil.rmtree(item, ignore_errors=True)
        except OSError:
            continue


def check_replaceable(path: Path) -> None:
    """Refuse to write a new database over a file that is none; a damaged database may go. Raises DatabaseError."""
    with explained(path):
        if path.is_dir():
            raise DatabaseError(f"Database {path} is a folder; give the database file itself.")
        with open(path, "rb") as file:
            start = file.read(72)
    # SQLite keeps the application's id in the header, at byte 68.
    if start and (start[: len(_MAGIC)] != _MAGIC or start[68:72] != APPLICATION_ID.to_bytes(4, "big")):
        raise DatabaseError(f"Database {path} is not a kpred database and would be lost; choose another name.")


def open_file(path: Path, read_only: bool, timeout: float, oldest: int = SCHEMA_VERSION) -> Engine:
    """Open an existing database as an engine of one connection, after checks of its content.

    `timeout`: seconds to wait for another process that writes; `oldest`: format that is not refused. Raises
    DatabaseError.
    """
    with explained(path):
        _check_magic(path)
        modes = ["ro", "ro&immutable=1"] if read_only else ["rw"]
        if any(path.with_name(path.name + suffix).exists() for suffix in ("-journal", "-wal")):
            modes = modes[:1]  # an unfinished write must be rolled back first, which an immutable file cannot
        for mode in modes:
            engine = _engine(path, mode, timeout)
            try:
                with engine.connect() as connection:
                    _check_kind(connection, path, oldest)
                return engine
            except DBAPIError as error:
                engine.dispose()
                # Where locks are not supported (some network and packed file systems) a read-only file still opens.
                if mode == modes[-1] or _code(error.orig) not in (sqlite3.SQLITE_CANTOPEN, sqlite3.SQLITE_IOERR):
                    raise
            except BaseException:
                engine.dispose()
                raise
    raise AssertionError("unreachable")


@contextmanager
def explained(path: Path) -> Iterator[None]:
    """Turn errors of SQLite and of the file system into a DatabaseError that names the file and the mend."""
    try:
        yield
    except DBAPIError as error:
        raise DatabaseError(f"Database {path}: {_sentence(error.orig)}") from error
    except sqlite3.Error as error:
        raise DatabaseError(f"Database {path}: {_sentence(error)}") from error
    except DamagedArray as error:
        raise DatabaseError(f"Database {path}: {error}; {_DAMAGED}") from error
    except OSError as error:
        reason = error.strerror or str(error)
        raise DatabaseError(f"Database {path}: {reason}; check the path, its permissions and the disk.") from error


def _engine(path: Path, mode: str, timeout: float) -> Engine:
    def connect() -> sqlite3.Connection:
        uri = f"{path.resolve().as_uri()}?mode={mode}"
        # Transactions are begun by the listener below, not guessed by the driver.
        connection = sqlite3.connect(uri, uri=True, timeout=timeout, isolation_level=None, check_same_thread=False)
        connection.execute("PRAGMA foreign_keys = ON")
        return connection

    # One connection only: `PRAGMA data_version` then changes exactly when another process has written.
    engine = create_engine("sqlite://", creator=connect, poolclass=StaticPool)

    @event.listens_for(engine, "begin")
    def begin(connection: Connection) -> None:
        write = connection.get_execution_options().get("kpred_write", False)
        connection.exec_driver_sql("BEGIN IMMEDIATE" if write else "BEGIN")

    return engine


def _check_magic(path: Path) -> None:
    if not path.exists():
        raise DatabaseError(f"Database {path} does not exist; check the path, or make it with 'kpred database build'.")
    if path.is_dir():
        raise DatabaseError(f"Database {path} is a folder; give the database file itself.")
    if not path.is_file():
        raise DatabaseError(f"Database {path} is a pipe or a device; give the database file itself.")
    with open(path, "rb") as file:
        start = file.read(len(_MAGIC))
    if start != _MAGIC:
        what = "is empty" if not start else "is not a kpred database"
        raise DatabaseError(f"Database {path} {what}; give a file made by 'kpred database build'.")


def _check_kind(connection: Connection, path: Path, oldest: int) -> None:
    def pragma(name: str) -> int:
        return int(connection.exec_driver_sql(f"PRAGMA {name}").scalar_one())

    if pragma("application_id") != APPLICATION_ID:
        raise DatabaseError(
            f"Database {path} is an SQLite file of another program; give a file made by 'kpred database build'."
        )
    version = pragma("user_version")
    if version > SCHEMA_VERSION:
        raise DatabaseError(
            f"Database {path} has format {version}, newer than format {SCHEMA_VERSION} of this kpred; upgrade kpred."
        )
    if version < OLDEST:
        raise DatabaseError(
            f"Database {path} has format {version}, older than format {OLDEST}, the oldest known here; build it again."
        )
    if version < oldest:
        raise DatabaseError(
            f"Database {path} has format {version}, older than format {oldest} of this kpred; run 'kpred database "
            f"update {path}', or build it again with 'kpred database build'."
        )
    if pragma("page_count") * pragma("page_size") > path.stat().st_size:
        raise DatabaseError(f"Database {path}: {_DAMAGED}")
    tables = {str(row[0]) for row in connection.exec_driver_sql("SELECT name FROM sqlite_master WHERE type = 'table'")}
    if not tables >= set(Base.metadata.tables):
        raise DatabaseError(f"Database {path}: {_DAMAGED}")


_DAMAGED = "the file is damaged or cut short; copy it again or build it again."

_SENTENCES = {
    sqlite3.SQLITE_BUSY: "another process is writing to it; wait until that ends and try again.",
    sqlite3.SQLITE_LOCKED: "another process is writing to it; wait until that ends and try again.",
    sqlite3.SQLITE_FULL: "the disk is full; free some space and run the same again, what was committed is kept.",
    sqlite3.SQLITE_NOTADB: _DAMAGED,
    sqlite3.SQLITE_CORRUPT: _DAMAGED,
    sqlite3.SQLITE_READONLY: "it cannot be written; copy it to a place where you may write, and open it there.",
    sqlite3.SQLITE_CANTOPEN: "it cannot be opened; check the permissions of the file and its folder.",
    sqlite3.SQLITE_IOERR: "reading or writing failed; check the disk and the file's permissions.",
    sqlite3.SQLITE_TOOBIG: "an array is too large to be stored; simplify the mesh.",
}


def _code(error: BaseException | None) -> int:
    # The low byte is the primary code, the rest says more than a user needs.
    return int(getattr(error, "sqlite_errorcode", 0) or 0) & 0xFF


def _sentence(error: BaseException | None) -> str:
    return _SENTENCES.get(_code(error), f"{error}; check the file, or build it again.")
