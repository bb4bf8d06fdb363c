"""What writes one file of an export."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

Writer = Callable[[Path], object]
"""Writes its file under the name it is called with (`kpred.atomic.write_together`)."""


def bytes_writer(content: bytes) -> Writer:
    """Return what writes these bytes."""
    return lambda file: file.write_bytes(content)
