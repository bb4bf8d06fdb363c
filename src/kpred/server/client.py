"""The client of `kpred serve`, by the standard library alone: it sends a scan and returns the files of its fit.

It loads neither torch nor numba, so that a command line with a server behind it starts at once.
"""

from __future__ import annotations

import http.client
import io
import json
import os
import secrets
import shutil
import tempfile
import time
import zipfile
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import IO, Any
from urllib.parse import urlsplit

import kpred.errors
from kpred.errors import ConfigError, KpredError, ScanError
from kpred.server.job import NOTES, VERSION

PATIENCE = 60.0
"""Seconds for which a busy server is tried again."""

ANSWER_SECONDS = 600.0
"""Without a byte from the server, after which it is given up."""


class ServerError(KpredError):
    """A server is not there, is busy, or answers in a way that makes no sense."""


@dataclass(frozen=True)
class ServerAnswer:
    """Files of a fit.

    Attributes:
        files: name -> content, the mesh first; record: of the fit, as the server names scan and mesh.
        notes: sentences about the scan; version: of the server's kpred.
    """

    files: Mapping[str, bytes]
    record: dict[str, Any]
    notes: tuple[str, ...]
    version: str


def request_fit(address: str, scan: Path, fields: Mapping[str, str], patience: float = PATIENCE) -> ServerAnswer:
    """Send a scan to a server and return the files of its fit.

    Args:
        address: such as http://127.0.0.1:8765; fields: of the form (docs/server.md).

    Raises:
        ScanError: the scan cannot be read here. ConfigError: no address.
        ServerError: no server is there, or it is busy for too long.
        KpredError: what the server says of the scan or the options, as a local fit does.
    """
    place = urlsplit(address)
    if place.scheme not in ("http", "https") or not place.hostname:
        raise ConfigError(f"{address}: a server's address begins with http:// and names a host; check --server.")
    with tempfile.TemporaryFile() as body:
        boundary = _write_form(body, scan, fields)
        until = time.monotonic() + patience
        while True:
            status, headers, content = _post(place.geturl(), body, boundary)
            if status not in (429, 503) or time.monotonic() > until:
                break
            time.sleep(min(float(headers.get("retry-after", "1")), max(until - time.monotonic(), 0.0)))
    if status != 200:
        raise _error(address, scan, status, content)
    return _answer(address, headers, content)


def _write_form(body: IO[bytes], scan: Path, fields: Mapping[str, str]) -> str:
    """Write a multipart form with the scan in it, and return its boundary."""
    boundary = secrets.token_hex(16)
    # A name is sent for messages alone: no folder, and nothing that could end the line.
    name = scan.name.encode("utf-8", "replace").decode().replace("\\", "_")
    quoted = "".join(f"%{ord(one):02X}" if one in '"\r\n' else one for one in name)
    for key, value in fields.items():
        body.write(f'--{boundary}\r\nContent-Disposition: form-data; name="{key}"\r\n\r\n{value}\r\n'.encode())
    head = f'--{boundary}\r\nContent-Disposition: form-data; name="scan"; filename="{quoted}"\r\n'
    body.write(f"{head}Content-Type: application/octet-stream\r\n\r\n".encode())
    try:
        if not scan.is_file():
            raise ScanError(f"{scan}: there is no such scan file; check the path.")
        with open(scan, "rb") as stream:
            shutil.copyfileobj(stream, body, 1 << 20)
    except OSError as error:
        raise ScanError(f"{scan}: {error.strerror or error}; give the file of the scan.") from error
    body.write(f"\r\n--{boundary}--\r\n".encode())
    return boundary


def _post(address: str, body: IO[bytes], boundary: str) -> tuple[int, Mapping[str, str], bytes]:
    place = urlsplit(address)
    kind = http.client.HTTPSConnection if place.scheme == "https" else http.client.HTTPConnection
    connection = kind(place.hostname or "", place.port, timeout=ANSWER_SECONDS)
    size = body.seek(0, os.SEEK_END)
    body.seek(0)
    headers = {"Content-Type": f"multipart/form-data; boundary={boundary}", "Content-Length": str(size)}
    try:
        # It may answer before all is sent, and end the connection: too large, or busy.
        with suppress(BrokenPipeError, ConnectionResetError):
            connection.request("POST", f"{place.path.rstrip('/')}/fit", body=body, headers=headers)
        response = connection.getresponse()
        found = {key.lower(): value for key, value in response.getheaders()}
        return response.status, found, response.read()
    except (OSError, http.client.HTTPException, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error) or type(error).__name__
        raise ServerError(
            f"{address}: no server answers there ({reason}); start it with kpred serve, or leave out --server and "
            "KPRED_SERVER."
        ) from error
    finally:
        connection.close()


def _error(address: str, scan: Path, status: int, content: bytes) -> KpredError:
    """Return the error that an answer describes, in the words of a local fit where it is about the scan."""
    try:
        found = json.loads(content)
        sentence, kind = str(found["error"]), str(found.get("kind", ""))
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return ServerError(f"{address}: it answers with status {status} and no reason; is it a server of kpred?")
    sentence = str(scan) + sentence[len(scan.name) :] if sentence.startswith(f"{scan.name}:") else sentence
    known = getattr(kpred.errors, kind, None)
    if isinstance(known, type) and issubclass(known, KpredError):
        return known(sentence)
    return ServerError(sentence)


def _answer(address: str, headers: Mapping[str, str], content: bytes) -> ServerAnswer:
    """Read the files of an answer. Their names are checked: they are written beside the user's files."""
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            files = {one.filename: archive.read(one) for one in archive.infolist()}
        if any(PurePosixPath(name).name != name or "\\" in name or name.startswith(".") for name in files):
            raise ValueError("it names files in folders")
        record = json.loads(next(files[name] for name in files if name.endswith(".json")))
        notes = tuple(str(note) for note in json.loads(headers.get(NOTES, "[]")))
        return ServerAnswer(files, record, notes, headers.get(VERSION, ""))
    except (zipfile.BadZipFile, ValueError, StopIteration, TypeError, RecursionError) as error:
        raise ServerError(f"{address}: its answer cannot be read ({error}); is it a server of kpred?") from error
