"""Files of a whole room, as downloads: the scene, its alignments, or each object in a format."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path
from tempfile import TemporaryDirectory

from kpred.errors import OutputError
from kpred.fitting.fit_scene import SceneFit
from kpred.studio.save_controls import as_download, safe_stem


def room_download(room: SceneFit, stem: str, extension: str = ".glb") -> tuple[str, bytes]:
    """Return the name and the bytes of a room in a format; several files become one ZIP.

    Raises:
        OutputError: no object is left in it, or the format holds one object or needs a library.
    """
    with TemporaryDirectory(prefix="kpred-studio-") as folder:
        return as_download(room.save(Path(folder) / f"{stem}{extension}"), Path(folder))


def alignments_download(room: SceneFit, stem: str) -> tuple[str, bytes]:
    """Return the name and the bytes of the alignments, as Scan2CAD's benchmark reads them."""
    with TemporaryDirectory(prefix="kpred-studio-") as folder:
        file = Path(folder) / f"{stem}.csv"
        room.to_csv(file)
        return file.name, file.read_bytes()


def objects_download(room: SceneFit, stem: str, extension: str) -> tuple[str, bytes]:
    """Return a ZIP of all objects of a room, a folder for each, in a format and in the scan's frame.

    Raises:
        OutputError: no object is left, a library of the format is missing, or a mesh cannot be written in it.
    """
    if not room.fitted:
        raise OutputError("No object is left in the room; take one in again.")
    packed = io.BytesIO()
    with (
        TemporaryDirectory(prefix="kpred-studio-") as folder,
        zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive,
    ):
        for number, item in enumerate(room.fitted, start=1):
            assert item.fit is not None
            name = safe_stem(item.object.name)
            own = Path(folder) / f"{number:03d}_{name}"
            own.mkdir()
            for file in item.fit.save(own / f"{name}{extension}"):
                archive.write(file, file.relative_to(folder))
    return f"{stem}{extension}.zip", packed.getvalue()
