"""The client: it waits for busy servers, believes none of their names, and loads nothing heavy."""

import io
import json
import subprocess
import sys
import threading
import zipfile
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from typing import Any

import pytest

from kpred._version import __version__
from kpred.errors import ConfigError, DatabaseError, ScanError
from kpred.server.client import ServerError, request_fit


def packed(*names: str) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name in names:
            archive.writestr(zipfile.ZipInfo(name), b"{}" if name.endswith(".json") else b"mesh")
    return buffer.getvalue()


class Answers(BaseHTTPRequestHandler):
    """Answers requests with what is next in the line."""

    line: list[tuple[int, dict[str, str], bytes]] = []
    bodies: list[bytes] = []

    def do_POST(self) -> None:
        self.bodies.append(self.rfile.read(int(self.headers["Content-Length"])))
        status, headers, body = self.line.pop(0)
        self.send_response(status)
        for key, value in (headers | {"Content-Length": str(len(body))}).items():
            self.send_header(key, value)
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *_: Any) -> None:
        pass


@pytest.fixture
def server() -> Iterator[str]:
    Answers.line, Answers.bodies = [], []
    running = HTTPServer(("127.0.0.1", 0), Answers)
    threading.Thread(target=running.serve_forever, args=(0.01,), daemon=True).start()
    yield f"http://127.0.0.1:{running.server_port}"
    running.shutdown()
    running.server_close()


@pytest.fixture
def scan(tmp_path: Path) -> Path:
    file = tmp_path / 'a "b"\nc.ply'
    file.write_bytes(b"\x00points\r\n--")
    return file


def test_a_busy_server_is_tried_again(server: str, scan: Path) -> None:
    busy = (503, {"Retry-After": "0.01"}, json.dumps({"error": "busy.", "kind": "Busy"}).encode())
    headers = {"kpred-notes": '["n"]', "kpred-version": __version__}
    Answers.line = [busy, busy, (200, headers, packed("r.glb", "r.json"))]
    found = request_fit(server, scan, {"up": "z"})
    assert list(found.files) == ["r.glb", "r.json"] and found.notes == ("n",) and found.version == __version__
    assert len(Answers.bodies) == 3 and Answers.bodies[0] == Answers.bodies[2]
    assert b"\x00points\r\n--" in Answers.bodies[0] and b'filename="a %22b%22%0Ac.ply"' in Answers.bodies[0]
    Answers.line = [busy]
    with pytest.raises(ServerError, match="busy"):
        request_fit(server, scan, {}, patience=0.0)


@pytest.mark.parametrize("name", ["../x.glb", "/etc/x.glb", "a/b.glb", "..\\x.glb", ".bashrc"])
def test_names_of_a_hostile_server_lead_nowhere(name: str, server: str, scan: Path) -> None:
    Answers.line = [(200, {}, packed("r.json", name))]
    with pytest.raises(ServerError, match="cannot be read"):
        request_fit(server, scan, {})


@pytest.mark.parametrize("body", [b"", b"<html>", packed("a.glb"), b"PK\x03\x04 broken"])
def test_answers_that_are_none(body: bytes, server: str, scan: Path) -> None:
    Answers.line = [(200, {}, body), (404, {}, body)]
    with pytest.raises(ServerError, match="cannot be read"):
        request_fit(server, scan, {})
    with pytest.raises(ServerError, match="status 404"):
        request_fit(server, scan, {})


def test_errors_are_those_of_a_local_fit(server: str, tmp_path: Path) -> None:
    scan = tmp_path / "a.ply"
    scan.write_bytes(b"x")
    for kind, error in (("ScanError", ScanError), ("DatabaseError", DatabaseError), ("os", ServerError)):
        Answers.line = [(422, {}, json.dumps({"error": "a.ply: it is empty.", "kind": kind}).encode())]
        with pytest.raises(error) as caught:
            request_fit(server, scan, {})
        assert str(caught.value) == f"{scan}: it is empty."


def test_no_server_no_scan_no_address(scan: Path, tmp_path: Path) -> None:
    with pytest.raises(ServerError, match="no server answers there"):
        request_fit("http://127.0.0.1:9", scan, {})
    with pytest.raises(ScanError, match="no such scan file"):
        request_fit("http://127.0.0.1:9", tmp_path / "none.ply", {})
    for address in ("127.0.0.1:8765", "ftp://a", "http://", "x"):
        with pytest.raises(ConfigError, match="begins with http"):
            request_fit(address, scan, {})


def test_a_fit_by_a_server_loads_nothing_heavy(server: str, scan: Path, tmp_path: Path) -> None:
    error = json.dumps({"error": "enough.", "kind": "ScanError"}).encode()
    Answers.line = [(422, {}, error)]
    heavy = ["torch", "numba", "numpy", "scipy", "trimesh", "sqlalchemy", "jaxtyping", "fastapi", "uvicorn"]
    words = ["fit", str(scan), "-o", str(tmp_path / "a.glb"), "--server", server]
    code = (
        f"import sys; from kpred.cli.main import main; print(main({words!r}), [m for m in {heavy} if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert done.stdout.strip() == "1 []", done.stderr
    assert done.stderr == "kpred: enough.\n"
