"""Passwords in addresses of databases: no command prints them, whatever goes wrong."""

import json
import time
import warnings
from collections.abc import Callable
from pathlib import Path

import pytest

from kpred.cli.main import FAILED, USAGE, main
from kpred.errors import DatabaseError

ADDRESSES = [
    "postgresql://me:hunter2@127.0.0.1:1/models",
    "postgresql://127.0.0.1:1/models?user=me&password=hunter2",
    "postgresql://me:hunter2@127.0.0.1:port/models",
    "postgresql+nodriver://me:hunter2@127.0.0.1:1/models",
    "postgresql://me:p@hunter2@127.0.0.1:1/models",
]


WORDS = [
    ["build", "PACK", "-o", "ADDRESS"],
    ["remove", "ADDRESS", "chair_1"],
    ["info", "ADDRESS"],
    ["copy", "ADDRESS", "NEW"],
    ["search", "ADDRESS", "SCAN"],
]


@pytest.mark.parametrize(
    ("address", "words"),
    [(ADDRESSES[0], words) for words in WORDS] + [(address, WORDS[2]) for address in ADDRESSES[1:]],
)
def test_no_command_prints_a_password(
    address: str, words: list[str], files: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    names = {
        "ADDRESS": address,
        "PACK": str(files / "table.npz"),
        "NEW": str(tmp_path / "new.kpred"),
        "SCAN": str(files / "scan.ply"),
    }
    more = ["--model", str(files / "model")] if words[0] in ("build", "search") else []
    start = time.monotonic()
    for last in ("--json", "--debug"):
        assert main(["database", *(names.get(word, word) for word in words), *more, last]) == FAILED
        printed = capsys.readouterr()
        assert "hunter2" not in printed.out + printed.err
        assert "postgresql" in printed.err
    assert time.monotonic() - start < 8, "a server that never was there is not waited for"


@pytest.mark.parametrize("words", [["demo", "--database"], ["plot", "catalogue"]])
def test_wrong_use_prints_no_password(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*words, ADDRESSES[0]]) == USAGE
    printed = capsys.readouterr()
    assert "hunter2" not in "".join((printed.out + printed.err).split())
    assert "postgresql" in printed.err


def test_a_batch_stores_no_password_and_goes_on_with_another(tmp_path: Path) -> None:
    from kpred.batch.journal import Journal
    from kpred.batch.worker import BatchSettings

    def job(word: str) -> dict[str, object]:
        return {"source": "scans", **BatchSettings(database=f"postgresql://me:{word}@host/db").to_dict()}

    with Journal(tmp_path / "out", job("hunter2")):
        assert "hunter2" not in (tmp_path / "out" / "job.json").read_text()
    with Journal(tmp_path / "out", job("rotated")):
        pass
    # What an earlier version stored is cleared, and is the same batch.
    old = job("x") | {"database": "postgresql://me:hunter2@host/db"}
    (tmp_path / "out" / "job.json").write_text(json.dumps(old))
    with Journal(tmp_path / "out", job("rotated")):
        assert "hunter2" not in (tmp_path / "out" / "job.json").read_text()


def test_fit_many_names_what_it_left_out_and_fails_when_nothing_was_fitted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], refusal: Callable[..., str]
) -> None:
    scans = tmp_path / "scans"
    scans.mkdir()
    (scans / "few.xyz").write_text("0 0 0\n1 1 1\n")
    for name in ("b.rcp", "c.fls", "d.skp", ".hidden.rcp"):
        (scans / name).write_text("stub")
    assert main(["fit-many", str(scans), "-o", str(tmp_path / "out"), "--workers", "1", "--json"]) == FAILED
    printed = capsys.readouterr()
    assert json.loads(printed.out)["left_out"] == {".fls": 1, ".rcp": 1, ".skp": 1}
    assert "left out: 3 files of kinds that are not read (1 .fls, 1 .rcp, 1 .skp)" in printed.err
    assert "none of its 1 scans could be fitted" in printed.err
    (scans / "few.xyz").unlink()
    said = refusal("fit-many", scans, "-o", tmp_path / "other", "--workers", "1")
    assert "there are no scans in it (it holds 1 .fls, 1 .rcp, 1 .skp)" in said


@pytest.mark.parametrize("kind", [RuntimeError, DatabaseError, OSError])
def test_errors_warnings_and_tracebacks_of_any_kind_are_masked(
    kind: type[Exception], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail(*_: object, **__: object) -> None:
        warnings.warn(f"slow: {ADDRESSES[0]}", stacklevel=1)
        raise kind(f"driver: no connection to {ADDRESSES[0]}")

    monkeypatch.setattr("kpred.database.Database.open", fail)
    for more in ([], ["--debug"]):
        assert main(["database", "info", "mine.kpred", *more]) == FAILED
        printed = capsys.readouterr().err
        assert "slow: postgresql://me:***@127.0.0.1" in printed
        assert "no connection to postgresql://me:***@127.0.0.1" in printed
        assert "hunter2" not in printed
