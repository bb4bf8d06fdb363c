"""What every reader has in common: checks before a file is opened, and one sentence for whatever goes wrong inside."""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from kpred.errors import KpredError

_GIT_LFS = b"version https://git-lfs"
_START = 64
_MARKS: tuple[tuple[bytes, str, tuple[str, ...]], ...] = (
    (b"ply\n", "a PLY file", (".ply",)),
    (b"ply\r", "a PLY file", (".ply",)),
    (b"# .PCD", "a PCD file", (".pcd",)),
    (b"glTF", "a binary glTF file", (".glb", ".gltf")),
    (b"LASF", "a LAS file", (".las", ".laz")),
    (b"ASTM-E57", "an E57 file", (".e57",)),
    (b"\x93NUMPY", "a NumPy array", (".npy",)),
    (b"PXR-USDC", "a USD file", (".usdc", ".usd")),
    (b"#usda", "a USD file", (".usda", ".usd")),
    (b"OFF\n", "an OFF file", (".off",)),
    (b"solid ", "an STL file", (".stl",)),
    (b"\x89PNG", "a PNG picture", (".png",)),
    (b"\xff\xd8\xff", "a JPEG picture", (".jpg", ".jpeg")),
    (b"\x89HDF", "an HDF5 file", (".h5", ".hdf5")),
    (b"MATLAB 5.0", "a MATLAB file", (".mat",)),
    (b"Kaydara FBX", "an FBX file", (".fbx",)),
    (b"ISO-10303-21", "a STEP or IFC file", (".stp", ".step", ".ifc")),
    (b"PAR1", "a Parquet file", (".parquet",)),
    (b"SQLite format 3", "an SQLite database", (".kpred", ".db")),
    (b"\x1f\x8b", "a file that is compressed by gzip", (".gz",)),
    (b"Rar!", "a RAR archive", (".rar",)),
    (b"7z\xbc\xaf", "a 7z archive", (".7z",)),
    (b"PK\x03\x04", "a ZIP archive", (".zip", ".npz", ".usdz", ".3mf", ".sh3f")),
    (b"<!doctype html", "a web page", ()),
    (b"<html", "a web page", ()),
)
"""First bytes of files, what they are, and their extensions."""

_MAX_POINTER = 1024
"""Bytes of a pointer of Git LFS; it has some 130."""


@contextmanager
def reading(path: str | os.PathLike[str], error_type: type[KpredError], kind: str = "") -> Iterator[None]:
    """Convert every exception of a parser to one `error_type` that names the file.

    Errors of the package pass as they are if they are of `error_type`, else with the same sentence. The bytes of a file
    are foreign, so that a parser may fail in any way; what failed stays in `__cause__`.

    Args:
        path: the file that is read.
        kind: what the file should be, for the sentence; without it, its extension.
    """
    what = kind or f"{Path(path).suffix.lower() or 'text'} file"
    try:
        yield
    except KpredError as error:
        _check_content(Path(path), error_type, error)
        if isinstance(error, error_type):
            raise
        raise error_type(str(error)) from error
    except OSError as error:
        reason = error.strerror or str(error) or type(error).__name__
        raise error_type(f"{path}: it cannot be read ({reason}); check the file and those it refers to.") from error
    except MemoryError as error:
        raise error_type(f"{path}: it needs more memory than there is; give a smaller file.") from error
    except RecursionError as error:
        raise error_type(f"{path}: it is nested too deeply to be a {what}; export it again.") from error
    except Exception as error:
        _check_content(Path(path), error_type, error)
        raise error_type(f"{path}: it is not a readable {what} ({_reason(error)}); export it again.") from error


def check_file(path: Path, error_type: type[KpredError], kind: str = "file") -> None:
    """Refuse a path that is missing, a folder, empty, or no regular file (a pipe would block for ever).

    Raises:
        KpredError: of `error_type`.
    """
    try:
        status = path.stat()
    except (FileNotFoundError, NotADirectoryError) as error:
        raise error_type(f"{path}: there is no such file; check the path.") from error
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise error_type(f"{str(path)[:200]!r}: it cannot be read ({reason}); check the path.") from error
    if stat.S_ISDIR(status.st_mode):
        raise error_type(f"{path}: it is a folder; give one {kind}.")
    if not stat.S_ISREG(status.st_mode):
        raise error_type(f"{path}: it is a pipe or a device; save the {kind} as a regular file.")
    if not status.st_size:
        raise error_type(f"{path}: the file is empty; save or export it again.")
    if status.st_size < _MAX_POINTER and os.access(path, os.R_OK) and path.read_bytes().startswith(_GIT_LFS):
        raise error_type(f"{path}: it is a pointer of Git LFS, not the file itself; fetch it by `git lfs pull`.")


def leads_outside(file: Path, owner: Path) -> bool:
    """Test whether links lead a file that `owner` names out of the folder of `owner`, as it is or as it is linked."""
    place = file.resolve()
    return not any(place.is_relative_to(folder) for folder in (owner.parent.resolve(), owner.resolve().parent))


def _check_content(path: Path, error_type: type[KpredError], cause: Exception) -> None:
    """Say what a file that could not be read is, where its first bytes say something else than its extension.

    Raises:
        KpredError: of `error_type`.
    """
    try:
        with open(path, "rb") as stream:
            start = stream.read(_START).removeprefix(b"\xef\xbb\xbf").lstrip(b"\r\n\t ")
    except OSError:
        return
    for mark, what, extensions in _MARKS:
        if start[: len(mark)].lower() == mark.lower() and path.suffix.lower() not in extensions:
            mend = f"name it {extensions[0]}" if extensions else "download it again"
            raise error_type(f"{path}: its content is that of {what}, not of {path.suffix}; {mend}.") from cause


def _reason(error: Exception) -> str:
    """Return the first line of an error's text, shortened."""
    lines = str(error).splitlines()
    return (lines[0] if lines else type(error).__name__)[:120]
