"""The SHA-256 of a file, by which the same input is recognized."""

from __future__ import annotations

import hashlib
import os


def file_sha256(file: str | os.PathLike[str]) -> str:
    """Hash a file's bytes, as 64 hexadecimal digits.

    Raises:
        OSError: it cannot be read.
    """
    with open(file, "rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
