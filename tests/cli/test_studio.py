"""`kpred studio`: records replay without a page, and wrong use is a sentence."""

import socket
from pathlib import Path

import pytest

from kpred.cli.main import main


def test_a_port_in_use_is_known_before_any_work(capsys: pytest.CaptureFixture[str]) -> None:
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        assert main(["studio", "--port", str(other.getsockname()[1])]) == 1
    error = capsys.readouterr().err
    assert "--port" in error and error.count("\n") == 1


def test_wrong_use_is_a_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    record = tmp_path / "x.json"
    record.write_text("{}")
    assert main(["studio", str(record), "-o", str(tmp_path / "x.obj")]) == 1
    assert "no record of kpred studio" in capsys.readouterr().err
    assert main(["studio", str(record), "-o", str(tmp_path / "x.obj"), "--up", "z"]) == 2
    assert main(["studio", str(tmp_path / "x.ply"), "-o", str(tmp_path / "x.obj")]) == 2
    assert "kpred fit" in capsys.readouterr().err
