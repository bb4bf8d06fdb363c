"""`kpred serve`: refusals, and one real server from its start to its end."""

import json
import os
import signal
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

import kpred
from kpred.cli.main import OK, USAGE, main
from kpred.server import run

SCAN = kpred.sample_scan()
QUICK = ["--category", "chair", "--up", "y", "--top-k", "2", "--deform", "none", "--no-picture"]


@pytest.mark.parametrize(
    "words", [["--workers", "0"], ["--max-requests", "0"], ["--time-limit", "nan"], ["--max-megabytes", "-1"]]
)
def test_impossible_limits(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["serve", *words]) == USAGE
    assert words[0] in capsys.readouterr().err


def test_a_port_in_use_is_known_before_the_work(refusal: Callable[..., str]) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        assert "choose another --port" in refusal("serve", "--port", taken.getsockname()[1])
    assert "from 0 to 65535" in refusal("serve", "--port", 70000)
    assert "served at 203.0.113.1:0" in refusal("serve", "--host", "203.0.113.1", "--port", 0)


def test_a_missing_library_names_the_extra(refusal: Callable[..., str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "uvicorn", None)
    assert "needs uvicorn, which is not installed: pip install 'kpred[serve]'" in refusal("serve", "--port", 0)


def test_one_worker_works_as_the_command_line_does() -> None:
    assert run.threads_each(1) is None and run.threads_each(1000) == 1


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[str, Path, int]]:
    """Address, temporary folder and process number of a server that fits at most 3 scans at once."""
    pytest.importorskip("fastapi", reason="fastapi is not installed (the extra serve)")
    folder = tmp_path_factory.mktemp("temporary")
    words = ["serve", "--port", "0", "--json", "--max-requests", "3", "--max-megabytes", "1"]
    process = subprocess.Popen(
        [sys.executable, "-m", "kpred", *words], stdout=subprocess.PIPE, env={**os.environ, "TMPDIR": str(folder)}
    )
    assert process.stdout is not None
    text = ""
    while not text.endswith("}\n"):
        line = process.stdout.readline().decode()
        assert line, "the server has ended"
        text += line
    yield json.loads(text)["address"], folder, process.pid
    process.send_signal(signal.SIGTERM)
    assert process.wait(60) == 143
    assert not list(folder.glob("kpred-serve-*"))


def contents(folder: Path) -> dict[str, Any]:
    """What files hold, without times and without the folder."""
    found: dict[str, Any] = {}
    for file in folder.iterdir():
        if file.suffix == ".json":
            record = json.loads(file.read_text().replace(str(folder), ""))
            record.pop("timings_seconds")
            found[file.name] = record
        else:
            found[file.name] = file.read_bytes()
    return found


def test_the_files_are_those_of_a_local_fit(server: Any, tmp_path: Path) -> None:
    (tmp_path / "here").mkdir()
    (tmp_path / "there").mkdir()
    assert main(["fit", str(SCAN), "-o", str(tmp_path / "here" / "a.obj"), *QUICK]) == OK
    assert main(["fit", str(SCAN), "-o", str(tmp_path / "there" / "a.obj"), *QUICK, "--server", server[0]]) == OK
    assert contents(tmp_path / "here") == contents(tmp_path / "there")


def test_refusals_are_those_of_a_local_fit(server: Any, tmp_path: Path, refusal: Callable[..., str]) -> None:
    (tmp_path / "a.doc").write_text("no scan")
    (tmp_path / "b.ply").write_text("ply\n")
    for name in ("a.doc", "b.ply"):
        words = ["fit", tmp_path / name, "-o", tmp_path / "a.glb"]
        assert refusal(*words) == refusal(*words, "--server", server[0])
    (tmp_path / "large.xyz").write_bytes(b"0 0 0\n" * 400_000)
    assert "larger than 1 MB" in refusal("fit", tmp_path / "large.xyz", "-o", tmp_path / "a.glb", "--server", server[0])


def test_fifty_at_once_are_fitted_or_sent_away_and_nothing_is_left(server: Any, tmp_path: Path) -> None:
    address, folder, _ = server
    body = b'--b\r\nContent-Disposition: form-data; name="scan"; filename="a.ply"\r\n\r\n' + SCAN.read_bytes()
    for key, value in (("answer", "mesh"), ("deform", "none"), ("category", "chair"), ("top_k", "1")):
        body += f'\r\n--b\r\nContent-Disposition: form-data; name="{key}"\r\n\r\n{value}'.encode()
    body += b"\r\n--b--\r\n"

    def post(number: int) -> int:
        if number % 10 == 9:  # these go away at once
            with socket.create_connection(("127.0.0.1", int(address.rpartition(":")[2]))) as gone:
                gone.sendall(b"POST /fit HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 500000\r\n\r\n" + body[:1000])
            return 0
        headers = {"Content-Type": "multipart/form-data; boundary=b"}
        try:
            with urllib.request.urlopen(urllib.request.Request(f"{address}/fit", body, headers), timeout=120) as answer:
                return answer.status if answer.read(4) == b"glTF" else -1
        except urllib.error.HTTPError as error:
            assert int(error.headers["Retry-After"]) > 0
            return error.code

    with ThreadPoolExecutor(50) as threads:
        found = list(threads.map(post, range(50)))
    assert set(found) <= {0, 200, 503} and found.count(200) >= 1 and found.count(0) == 5
    until = time.monotonic() + 60
    while list(folder.glob("kpred-serve-*/*")) and time.monotonic() < until:
        time.sleep(0.1)
    assert not list(folder.glob("kpred-serve-*/*"))
    with urllib.request.urlopen(f"{address}/health") as answer:
        assert json.load(answer)["waiting"] == 0
    assert post(0) == 200


def test_a_worker_that_is_killed_is_replaced(server: Any, tmp_path: Path) -> None:
    address, _, parent = server
    tasks = Path(f"/proc/{parent}/task").iterdir()
    children = [int(word) for task in tasks for word in (task / "children").read_text().split()]
    for child in children:
        if b"spawn_main" in Path(f"/proc/{child}/cmdline").read_bytes():
            os.kill(child, signal.SIGKILL)
    assert main(["fit", str(SCAN), "-o", str(tmp_path / "a.glb"), *QUICK, "--server", address]) == OK
