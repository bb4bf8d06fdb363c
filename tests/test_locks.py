"""Locks between processes: the second is told, the same thread may come again, nothing is left behind."""

import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from kpred.errors import OutputError
from kpred.locks import exclusive

HOLD = """
import sys
from pathlib import Path
from kpred.locks import exclusive
with exclusive(Path(sys.argv[1]), OSError("busy")):
    print("held", flush=True)
    sys.stdin.read()
"""


def test_the_second_process_is_told_until_the_first_is_done(tmp_path: Path) -> None:
    file = tmp_path / ".lock"
    with subprocess.Popen([sys.executable, "-c", HOLD, file], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as child:
        assert child.stdout is not None
        assert child.stdout.readline() == b"held\n"
        with pytest.raises(OutputError, match="busy"), exclusive(file, OutputError("busy")):
            pytest.fail("held twice")
        assert file.exists()
        child.communicate(b"")
    assert not file.exists()
    with exclusive(file, OutputError("busy")):
        assert file.exists()
    assert not file.exists()


def test_a_killed_process_lets_go(tmp_path: Path) -> None:
    file = tmp_path / ".lock"
    with subprocess.Popen([sys.executable, "-c", HOLD, file], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as child:
        assert child.stdout is not None
        assert child.stdout.readline() == b"held\n"
        child.send_signal(signal.SIGKILL)
        child.wait()
    with exclusive(file, OutputError("busy")):
        pass
    assert list(tmp_path.iterdir()) == []


def test_the_same_thread_may_hold_it_again_and_another_may_not(tmp_path: Path) -> None:
    file, told = tmp_path / ".lock", []

    def other() -> None:
        try:
            with exclusive(file, OutputError("busy")):
                told.append("held")
        except OutputError:
            told.append("busy")

    with exclusive(file, OutputError("busy")):
        with exclusive(file, OutputError("busy")):
            pass
        assert file.exists()
        thread = threading.Thread(target=other)
        thread.start()
        thread.join()
    other()
    assert told == ["busy", "held"]


def test_one_at_a_time_among_many_threads(tmp_path: Path) -> None:
    inside, most, done = [0], [0], [0]

    def work() -> None:
        while done[0] < 200:
            try:
                with exclusive(tmp_path / ".lock", OutputError("busy")):
                    inside[0] += 1
                    most[0] = max(most[0], inside[0])
                    inside[0] -= 1
                    done[0] += 1
            except OutputError:
                continue

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert most[0] == 1


def test_where_nothing_can_be_locked_the_work_is_done(tmp_path: Path) -> None:
    done = []
    with exclusive(tmp_path / "missing" / ".lock", OutputError("busy")):
        done.append(1)
    assert done == [1]
