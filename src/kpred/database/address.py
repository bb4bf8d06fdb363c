"""Addresses of database servers, and how they are shown and stored: without their passwords."""

from __future__ import annotations

import os
import re

_ADDRESS = re.compile(r"postgres(ql)?(\+\w+)?:/")
_IN_AUTHORITY = re.compile(r"(postgres(?:ql)?(?:\+\w+)?:/+[^:/@\s]*):\S*@")
_IN_QUERY = re.compile(r"([?&](?:ssl)?password=)[^&\s]*", re.IGNORECASE)


def is_address(path: str | os.PathLike[str]) -> bool:
    """Test whether this is a server's address rather than a file."""
    return _ADDRESS.match(os.fspath(path)) is not None


def masked(text: str | os.PathLike[str]) -> str:
    """Replace the passwords of all addresses in a text by ***; other text stays."""
    return _IN_QUERY.sub(r"\1***", _IN_AUTHORITY.sub(r"\1:***@", os.fspath(text)))


def without_password(place: str | os.PathLike[str]) -> str:
    """Drop the password of an address; a file name stays as it is."""
    text = os.fspath(place)
    if not is_address(text):
        return text
    bare = _IN_QUERY.sub(r"\1", _IN_AUTHORITY.sub(r"\1@", text))
    return re.sub(r"(?<=[?&])(?:ssl)?password=(?:&|$)", "", bare, flags=re.IGNORECASE).rstrip("?&")
