from pathlib import Path

import pytest

from kpred.batch.worker import BatchSettings
from kpred.database import Database
from kpred.database.address import is_address, masked, without_password
from kpred.errors import DatabaseError


@pytest.mark.parametrize(
    ("address", "shown", "stored"),
    [
        ("postgresql://me:S@host:5432/db", "postgresql://me:***@host:5432/db", "postgresql://me@host:5432/db"),
        ("postgres://me:S@host/db", "postgres://me:***@host/db", "postgres://me@host/db"),
        ("postgresql+psycopg://me:S@host/db", "postgresql+psycopg://me:***@host/db", "postgresql+psycopg://me@host/db"),
        ("postgresql:/me:S@host/db", "postgresql:/me:***@host/db", "postgresql:/me@host/db"),
        ("postgresql://me:S@S@host/db", "postgresql://me:***@host/db", "postgresql://me@host/db"),
        ("postgresql://host/db?password=S", "postgresql://host/db?password=***", "postgresql://host/db"),
        (
            "postgresql://host/db?user=me&PASSWORD=S&sslmode=require",
            "postgresql://host/db?user=me&PASSWORD=***&sslmode=require",
            "postgresql://host/db?user=me&sslmode=require",
        ),
        ("postgresql://me@host/db", "postgresql://me@host/db", "postgresql://me@host/db"),
        ("postgresql://host:5432/db", "postgresql://host:5432/db", "postgresql://host:5432/db"),
        ("Postgres://me:S@host/db", "Postgres://me:***@host/db", "Postgres://me@host/db"),
        ("folder/mine.kpred", "folder/mine.kpred", "folder/mine.kpred"),
    ],
)
def test_passwords_are_neither_shown_nor_stored(address: str, shown: str, stored: str) -> None:
    for secret in ("hunter2", "a%20b", "x:y"):
        full = address.replace("S", secret, 2) if "PASSWORD" not in address else address.replace("=S", f"={secret}")
        assert masked(full) == shown
        assert without_password(full) == stored
        assert masked(f"kpred database info {full} --json") == f"kpred database info {shown} --json"
        assert is_address(full) == address.lower().startswith("postgres")


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("mysql://me:hunter2@host/db", "mysql://me:***@host/db"),
        ("postgre://me:hunter2@host/db", "postgre://me:***@host/db"),
        ("postgresql://me:hunter2 hunter2@host/db", "postgresql://me:***@host/db"),
        ("host=h password=hunter2 dbname=x", "host=h password=*** dbname=x"),
        ("host=h password = 'hunter2 x' dbname=x", "host=h password = *** dbname=x"),
        ("postgresql://h/db?pass%77ord=hunter2&x=1", "postgresql://h/db?pass%77ord=***&x=1"),
        ("postgresql://h/db?%70ASSword=hunter2", "postgresql://h/db?%70ASSword=***"),
        ("postgresql://h/db?%73%73%6c%70%61%73%73%77%6f%72%64=hunter2", None),
        ("postgresql://h/db?password=hunter'2hunter", "postgresql://h/db?password=***"),
        ("host=h password='hunter\\'2 hunter' dbname=x", "host=h password=*** dbname=x"),
        (r"host=h password=a\ hunter2 dbname=x", "host=h password=*** dbname=x"),
        ('{"database": "postgresql://h/db?password=hunter2"}', '{"database": "postgresql://h/db?password=***"}'),
        ("PGPASSWORD=hunter2 kpred database info x", "PGPASSWORD=*** kpred database info x"),
        ("oauth_client_secret=hunter2", "oauth_client_secret=***"),
        ("machine h login me password hunter2", "machine h login me password ***"),
        ("host:5432:db:me:hunter2", "host:5432:db:me:***"),
        ("*:*:*:me:hunter2", "*:*:*:me:***"),
        ("FATAL: password authentication failed for user me", "FATAL: password authentication failed for user me"),
        ("a.py:12:5: error: x", "a.py:12:5: error: x"),
        ("--cleaning.floor=False", "--cleaning.floor=False"),
        ("postgresql://host:5432/db: ask me@host", "postgresql://host:5432/db: ask me@host"),
    ],
)
def test_passwords_of_mistyped_addresses_are_masked(text: str, shown: str | None) -> None:
    assert masked(text) == shown if shown is not None else "hunter2" not in masked(text)
    assert masked(masked(text)) == masked(text)


@pytest.mark.parametrize("key", ["password", "pass%77ord", "%73slpassword", "PASSWORD"])
def test_percent_encoded_passwords_are_not_stored(key: str) -> None:
    assert without_password(f"postgresql://me@h/db?a=1&{key}=hunter2&b=2") == "postgresql://me@h/db?a=1&b=2"
    assert without_password(f"postgresql://me@h/db?{key}=hunter2") == "postgresql://me@h/db"


@pytest.mark.parametrize(
    "address", ["mysql://me:hunter2@host/db", "postgre://host/db", "https://host/a.kpred", "host=h dbname=x"]
)
def test_addresses_of_other_kinds_are_no_files(address: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for use in (Database.open, Database.create, Database.exists):
        with pytest.raises(DatabaseError, match="is no address of a database; write postgresql://") as caught:
            use(address)
        assert "hunter2" not in str(caught.value)
    assert not list(tmp_path.iterdir())


def test_a_batch_is_the_same_with_another_password() -> None:
    one, other = (BatchSettings(database=f"postgresql://me:{word}@host/db").to_dict() for word in ("old", "new"))
    assert one == other and "old" not in str(one)
