"""Where the bundled sample scan lies."""

from __future__ import annotations

from importlib import resources
from pathlib import Path

from kpred.errors import ScanError


def sample_scan() -> Path:
    """The sample scan that comes with the package.

    Raises:
        ScanError: it is missing, as in a damaged installation.
    """
    folder = Path(str(resources.files("kpred"))) / "bundled"
    scans = sorted(folder.rglob("*.ply"))
    if not scans:
        raise ScanError(f"{folder}: the bundled sample scan is missing; install kpred again.")
    return scans[0]
