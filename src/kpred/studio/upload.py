"""Scans that come from the browser: how large they may be, and reading them; no other file is read by their help."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from kpred.errors import KpredError, ScanError
from kpred.ops.typing import Float
from kpred.shapes.scan import SCAN_EXTENSIONS, read_scan
from kpred.studio.save_controls import safe_stem

MAX_UPLOAD = 256_000_000
"""Bytes of a scan that is sent by the browser."""

UPLOAD_EXTENSIONS = tuple(one for one in SCAN_EXTENSIONS if one != ".gltf")
"""Scans that are one file; a .gltf names others."""


def read_upload(name: str, content: bytes) -> tuple[str, Float[np.ndarray, "points 3"]]:
    """Read the points of a scan (N, 3) that was sent; the name, of any origin, gives no more than the format.

    Returns:
        A plain name of the file, and its points.

    Raises:
        ScanError: unknown format, or the file cannot be read.
    """
    extension = Path(name.replace("\\", "/")).suffix.lower()
    if extension not in UPLOAD_EXTENSIONS:
        raise ScanError(f"A scan of the type {extension[:10]!r} cannot be sent; send {', '.join(UPLOAD_EXTENSIONS)}.")
    plain = f"{safe_stem(name)}{extension}"
    with TemporaryDirectory(prefix="kpred-studio-") as folder:
        file = Path(folder) / plain
        file.write_bytes(content)
        try:
            return plain, read_scan(file)
        except KpredError as error:
            raise ScanError(str(error).replace(str(file), plain)) from error


class UploadLimit:
    """Bounds what a browser may send to one tab: one file at a time, no larger than a limit.

    Args:
        gui: viser's, of the tab; refuse: is given the sentence of an error; limit: bytes of a file.
    """

    def __init__(self, gui: Any, refuse: Callable[[str], None], limit: int = MAX_UPLOAD) -> None:
        from viser import _messages

        self._gui, self._refuse, self._limit = gui, refuse, limit
        self._files: dict[str, Any] = gui._current_file_upload_states
        # viser keeps all that is sent, of any size; it has no place for a limit of its own.
        interface = gui._websock_interface
        for kind, before, bounded in (
            (_messages.FileTransferStart, gui._handle_file_transfer_start, self._start),
            (_messages.FileTransferPart, gui._handle_file_transfer_part, self._part),
        ):
            interface.unregister_handler(kind, before)
            interface.register_handler(kind, bounded)

    def _start(self, client_id: int, message: Any) -> None:
        self._files.clear()
        if not 0 < message.size_bytes <= self._limit:
            megabytes = self._limit // 1_000_000
            self._refuse(f"The file is empty or larger than {megabytes} MB; thin the scan, or give it to kpred studio.")
            return
        self._gui._handle_file_transfer_start(client_id, message)

    def _part(self, client_id: int, message: Any) -> None:
        file = self._files.get(message.transfer_uuid)
        if file is None:
            return
        total = file["transferred_bytes"] + len(message.content)
        is_new = 0 <= message.part < file["part_count"] and message.part not in file["parts"]
        if not is_new or total > file["total_bytes"] or message.source_component_uuid is None:
            self._files.clear()
            self._refuse("The file was not received whole; send it again.")
            return
        self._gui._handle_file_transfer_part(client_id, message)
