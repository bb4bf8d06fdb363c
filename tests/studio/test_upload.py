"""Scans sent by the browser: read under a plain name; no other file, none too large, none in pieces that do not fit."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from kpred.errors import ScanError
from kpred.fitting import sample_scan
from kpred.shapes.scan import read_scan
from kpred.studio.upload import UploadLimit, read_upload

LIMIT = 1000


def test_a_scan_that_was_sent_is_read(tmp_path: Any) -> None:
    name, points = read_upload("../../a chair.ply", sample_scan().read_bytes())
    assert name == "a_chair.ply"
    np.testing.assert_array_equal(points, read_scan(sample_scan()))


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("chair.exe", b"MZ"),
        ("chair", b""),
        ("chair.gltf", b'{"buffers": [{"uri": "/etc/passwd"}]}'),
        ("chair.ply", b"ply\nformat ascii 1.0\n"),
        ("C:\\chair.ply\\x", b"1 2 3"),
        ("chair.npy", b"\x93NUMPY\x01\x00"),
    ],
)
def test_what_is_no_scan_is_one_sentence_without_a_path(name: str, content: bytes) -> None:
    with pytest.raises(ScanError) as failure:
        read_upload(name, content)
    assert "\n" not in str(failure.value) and "/tmp" not in str(failure.value)


class _Gui:
    """What `UploadLimit` uses of viser: it notes what reaches the handlers of before."""

    def __init__(self) -> None:
        self.reached: list[Any] = []
        self._current_file_upload_states: dict[str, Any] = {}
        self.handlers: dict[type, Any] = {}
        self._websock_interface = SimpleNamespace(
            unregister_handler=lambda kind, handler: None, register_handler=self.handlers.__setitem__
        )

    def _handle_file_transfer_start(self, client: int, message: Any) -> None:
        self.reached.append(message)
        self._current_file_upload_states[message.transfer_uuid] = {
            "part_count": message.part_count, "parts": {}, "total_bytes": message.size_bytes, "transferred_bytes": 0,
        }  # fmt: skip

    def _handle_file_transfer_part(self, client: int, message: Any) -> None:
        self.reached.append(message)
        state = self._current_file_upload_states[message.transfer_uuid]
        state["parts"][message.part] = message.content
        state["transferred_bytes"] += len(message.content)


@pytest.fixture
def limited() -> tuple[_Gui, list[str], Any]:
    messages = pytest.importorskip("viser._messages", reason="viser is not installed (the extra studio)")
    gui, refused = _Gui(), list[str]()
    UploadLimit(gui, refused.append, LIMIT)

    def send(kind: str, **fields: Any) -> None:
        known = {"source_component_uuid": "button", "transfer_uuid": "a", **fields}
        if kind == "start":
            message = messages.FileTransferStart(filename="x.ply", mime_type="", **known)
            gui.handlers[messages.FileTransferStart](0, message)
        else:
            gui.handlers[messages.FileTransferPart](0, messages.FileTransferPart(**known))

    return gui, refused, send


def test_files_up_to_the_limit_pass(limited: tuple[_Gui, list[str], Any]) -> None:
    gui, refused, send = limited
    send("start", part_count=2, size_bytes=LIMIT)
    send("part", part=0, content=bytes(600))
    send("part", part=1, content=bytes(400))
    assert len(gui.reached) == 3 and not refused


@pytest.mark.parametrize("size", [LIMIT + 1, 2_000_000_000, 0, -5])
def test_larger_and_empty_files_are_refused_before_they_are_sent(
    limited: tuple[_Gui, list[str], Any], size: int
) -> None:
    gui, refused, send = limited
    send("start", part_count=1, size_bytes=size)
    send("part", part=0, content=bytes(500))
    assert not gui.reached and len(refused) == 1


@pytest.mark.parametrize(("part", "content"), [(0, bytes(900)), (-1, b"x"), (2, b"x")])
def test_parts_that_do_not_fit_end_the_file(limited: tuple[_Gui, list[str], Any], part: int, content: bytes) -> None:
    gui, refused, send = limited
    send("start", part_count=2, size_bytes=500)
    send("part", part=part, content=content)
    assert len(refused) == 1 and not gui._current_file_upload_states


def test_one_file_at_a_time_is_kept(limited: tuple[_Gui, list[str], Any]) -> None:
    gui, _, send = limited
    for name in "abc":
        send("start", transfer_uuid=name, part_count=2, size_bytes=500)
    assert list(gui._current_file_upload_states) == ["c"]
