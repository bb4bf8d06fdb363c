"""`kpred studio`: records replay without a page, and wrong use is a sentence."""

import shutil
import socket
from pathlib import Path

import numpy as np
import pytest

from kpred.cli.main import main
from kpred.fitting import sample_scan
from kpred.fitting.options import FitOptions
from kpred.fitting.stages import Context
from kpred.shapes import read_mesh, read_scan
from kpred.studio.gestures import WHOLE, SetSize
from kpred.studio.record import session_record
from kpred.studio.session import Session
from kpred.studio.state import State


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


def test_refit_replays_a_session(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shutil.copy(sample_scan(), tmp_path / "chair.ply")
    start = State.of(read_scan(tmp_path / "chair.ply"), Context.load(None, None, None), FitOptions())
    session = Session(start)
    session.do(SetSize(WHOLE, "y", 1.04 * float(start.part_sizes(WHOLE)[1])))
    record = tmp_path / "chair.studio.json"
    record.write_text(session_record(session, "chair.ply"))
    assert main(["refit", str(record), "-o", str(tmp_path / "again.ply")]) == 0
    np.testing.assert_allclose(read_mesh(tmp_path / "again.ply").vertices, session.state.vertices, atol=1e-6)
    assert main(["refit", str(record)]) == 0
    assert (tmp_path / "chair_refit.glb").stat().st_size > 0
