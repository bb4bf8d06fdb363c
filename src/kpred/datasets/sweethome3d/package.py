"""Getting Debian's package `sweethome3d-furniture`: installed, as a file, or downloaded by apt."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

from kpred.errors import MeshError

PACKAGE = "sweethome3d-furniture"
INSTALLED = Path("/usr/share/sweethome3d/furniture")
PAGE = "https://packages.debian.org/stable/sweethome3d-furniture"


def find_libraries(source: str | os.PathLike[str] | None, scratch: Path) -> list[Path]:
    """List the furniture libraries (.sh3f) of a folder, of a Debian package, or of the installed package.

    Args:
        source: a folder of libraries, one library, or a package (.deb); None takes the installed package, and
            downloads it by apt where it is not installed.
        scratch: an empty folder, for what is unpacked.

    Raises:
        MeshError: there are no libraries, or the package cannot be had.
    """
    place = Path(source) if source is not None else INSTALLED
    if source is None and not INSTALLED.is_dir():
        place = _download(scratch)
    if place.suffix == ".deb":
        place = _unpack(place, scratch / "package")
    found = [place] if place.is_file() else sorted(place.rglob("*.sh3f"))
    if not found:
        raise MeshError(f"{place}: there are no furniture libraries (.sh3f) in it; give the package {PACKAGE}.")
    return found


def _download(scratch: Path) -> Path:
    scratch.mkdir(parents=True, exist_ok=True)
    _run(["apt-get", "download", PACKAGE], scratch)
    packages = sorted(scratch.glob("*.deb"))
    if not packages:
        raise MeshError(f"apt has no package {PACKAGE}; download it from {PAGE}, and give the file.")
    return packages[0]


def _unpack(package: Path, folder: Path) -> Path:
    if not package.is_file():
        raise MeshError(f"{package}: there is no such file; check the path.")
    folder.mkdir(parents=True, exist_ok=True)
    _run(["dpkg-deb", "-x", str(package.resolve()), str(folder)], package.parent)
    return folder


def _run(command: list[str], folder: Path) -> None:
    try:
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    except OSError as error:
        raise MeshError(
            f"{PACKAGE} cannot be had by {command[0]} ({error.strerror}); unpack {PAGE} and give its folder."
        ) from error
    if done.returncode:
        reason = (done.stderr.strip().splitlines() or ["no reason given"])[-1][:200]
        raise MeshError(f"{PACKAGE} cannot be had: {reason} Download it from {PAGE}, and give the file.")
