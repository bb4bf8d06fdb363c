import pytest

from kpred.batch.worker import BatchSettings
from kpred.database.address import is_address, masked, without_password


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
        ("folder/mine.kpred", "folder/mine.kpred", "folder/mine.kpred"),
    ],
)
def test_passwords_are_neither_shown_nor_stored(address: str, shown: str, stored: str) -> None:
    for secret in ("hunter2", "a%20b", "x:y"):
        full = address.replace("S", secret, 2) if "PASSWORD" not in address else address.replace("=S", f"={secret}")
        assert masked(full) == shown
        assert without_password(full) == stored
        assert masked(f"kpred database info {full} --json") == f"kpred database info {shown} --json"
        assert is_address(full) == address.startswith("postgres")


def test_a_batch_is_the_same_with_another_password() -> None:
    one, other = (BatchSettings(database=f"postgresql://me:{word}@host/db").to_dict() for word in ("old", "new"))
    assert one == other and "old" not in str(one)
