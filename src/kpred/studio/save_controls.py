"""Controls that save: every format of a result, and the record of the session, as downloads of the browser.

Nothing is written on the side of the program but a folder that is removed at once.
"""

from __future__ import annotations

import io
import re
import zipfile
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from kpred.errors import KpredError
from kpred.exports.format_table import FORMATS
from kpred.fitting.result import Fit
from kpred.studio.record import session_record

if TYPE_CHECKING:
    from kpred.studio.page import Page


class SaveControls:
    """The tab `Save` of a page."""

    def __init__(self, page: Page) -> None:
        self._page = page
        gui = page.client.gui
        for extension, known in FORMATS.items():
            button = gui.add_button(f"{extension}  {known.name}")
            button.on_click(lambda _, extension=extension: self._export(extension))
        record = gui.add_button("Record of the session", hint="kpred studio RECORD goes on from there")
        record.on_click(lambda _: self._record())

    def _export(self, extension: str) -> None:
        page = self._page
        try:
            name, content = download(page.state.result, safe_stem(page.name), extension)
        except KpredError as error:
            page.fail(str(error))
            return
        page.client.send_file_download(name, content)
        page.note(f"{name} was sent to the browser.")

    def _record(self) -> None:
        page = self._page
        name = f"{safe_stem(page.name)}.studio.json"
        page.client.send_file_download(name, session_record(page.session, page.name).encode())
        page.note(f"{name} was sent to the browser; keep it beside the scan, and open it with kpred studio.")


def download(fit: Fit, stem: str, extension: str) -> tuple[str, bytes]:
    """Return the name and the bytes of a result in a format; several files become one ZIP.

    Raises:
        OutputError: a library of the format is missing, or the mesh cannot be written in it.
    """
    with TemporaryDirectory(prefix="kpred-studio-") as folder:
        files = fit.save(Path(folder) / f"{stem}{extension}")
        return as_download(files, Path(folder))


def as_download(files: Sequence[Path], folder: Path) -> tuple[str, bytes]:
    """Return the name and the bytes of a file, or of several in a folder as one ZIP named by the first."""
    if len(files) == 1:
        return files[0].name, files[0].read_bytes()
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for file in files:
            archive.write(file, file.relative_to(folder))
    return f"{files[0].name}.zip", packed.getvalue()


def safe_stem(name: str) -> str:
    """Make the stem of a file's name that is safe on every system."""
    return re.sub(r"[^A-Za-z0-9_-]+", "_", Path(name).stem).strip("_")[:60] or "scan"
