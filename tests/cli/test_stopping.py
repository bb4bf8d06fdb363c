"""SIGTERM and SIGHUP stop a command as Ctrl-C does, with its workers; an ignored SIGHUP stays ignored."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from kpred.cli.stopping import Stopped, report_stop, stopped_by_signals

ONE_THREAD = {"OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"}


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_signal_raises_in_the_block_and_its_handler_is_as_before(number: signal.Signals) -> None:
    before = signal.getsignal(number)
    with pytest.raises(Stopped) as caught, stopped_by_signals():
        os.kill(os.getpid(), number)
        time.sleep(5)
    assert caught.value.number == number
    assert signal.getsignal(number) is before


def test_an_ignored_signal_stays_ignored() -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with stopped_by_signals():
            os.kill(os.getpid(), signal.SIGHUP)
    finally:
        signal.signal(signal.SIGHUP, before)


def test_the_sentence_names_the_signal_and_what_can_be_done(capsys: pytest.CaptureFixture[str]) -> None:
    with_words = KeyboardInterrupt("the same command goes on")
    with_words.__cause__ = Stopped(signal.SIGTERM)
    assert report_stop(with_words) == 143
    assert report_stop(Stopped(signal.SIGHUP)) == 129
    assert report_stop(KeyboardInterrupt()) == 130
    assert capsys.readouterr().err.splitlines() == [
        "kpred: stopped by SIGTERM; the same command goes on",
        "kpred: stopped by SIGHUP",
        "kpred: stopped by Ctrl-C",
    ]


def children(parent: int) -> set[int]:
    """All processes below one, by /proc."""
    parents = {}
    for place in Path("/proc").glob("[0-9]*"):
        try:
            fields = (place / "stat").read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if fields[0] != "Z":
            parents[int(place.name)] = int(fields[1])
    found, new = set(), {parent}
    while new:
        new = {child for child, above in parents.items() if above in new} - found
        found |= new
    return found


def running(pids: set[int]) -> set[int]:
    alive = set()
    for pid in pids:
        try:
            state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
        except OSError:
            continue
        alive |= {pid} if state != "Z" else set()
    return alive


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_a_stopped_batch_takes_its_workers_with_it_and_goes_on(number: signal.Signals, tmp_path: Path) -> None:
    (tmp_path / "scans").mkdir()
    rng = np.random.default_rng(0)
    for index in range(400):
        np.save(tmp_path / "scans" / f"{index:03d}.npy", rng.uniform(-1, 1, (300, 3)))
    line = [sys.executable, "-m", "kpred", "fit-many", "scans", "-o", "out", "--workers", "2", "--mesh", "none"]
    options = {"cwd": tmp_path, "env": os.environ | ONE_THREAD, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen([*line, "--up", "y"], start_new_session=True, **options) as child:
        deadline = time.monotonic() + 240
        while not list((tmp_path / "out").glob("[0-9][0-9][0-9].json")) and time.monotonic() < deadline:
            assert child.poll() is None, child.stderr.read()
            time.sleep(0.05)
        below = children(child.pid)
        assert len(below) >= 2
        child.send_signal(number)
        child.wait(timeout=120)
        errors = child.stderr.read()
    deadline = time.monotonic() + 20
    while running(below) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not running(below)
    if number == signal.SIGKILL:
        assert child.returncode == -signal.SIGKILL
    else:
        assert child.returncode == 128 + number
        assert f"stopped by {number.name}" in errors
    done = len(list((tmp_path / "out").glob("[0-9][0-9][0-9].json")))
    assert 0 < done < 400
