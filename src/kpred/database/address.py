"""Addresses of database servers, and how they are shown and stored: without their passwords."""

from __future__ import annotations

import os
import re

from kpred.errors import DatabaseError

_ADDRESS = re.compile(r"postgres(ql)?(\+\w+)?:/", re.IGNORECASE)
_OTHER = re.compile(r"[a-z][a-z0-9+.-]+:/|(?:host|hostaddr|dbname|user|password|service)\s*=", re.IGNORECASE)
# Any scheme: a mistyped one has a password too. A password with blanks ends before the next / or :.
_IN_AUTHORITY = re.compile(r"([a-z][a-z0-9+.-]*:/+[^:/@\s]*):(?:\S*|[^/:@\n]*)@", re.IGNORECASE)
_IN_QUERY = re.compile(r"((?:ssl)?password\s*=\s*)('[^']*'|\"[^\"]*\"|[^&\s'\"]*)", re.IGNORECASE)


def is_address(path: str | os.PathLike[str]) -> bool:
    """Test whether this is a server's address rather than a file.

    Raises:
        DatabaseError: it is the address of something else, of which a file would be made.
    """
    text = os.fspath(path)
    if _ADDRESS.match(text) is None and _OTHER.match(text) is not None:
        raise DatabaseError(f"{masked(text)} is no address of a database; write postgresql://user@host/name.")
    return _ADDRESS.match(text) is not None


def masked(text: str | os.PathLike[str]) -> str:
    """Replace the passwords of all addresses, and behind `password=`, in a text by ***; other text stays."""
    return _IN_QUERY.sub(r"\1***", _IN_AUTHORITY.sub(r"\1:***@", os.fspath(text)))


def without_password(place: str | os.PathLike[str]) -> str:
    """Drop the password of an address; a file name stays as it is."""
    text = os.fspath(place)
    if not is_address(text):
        return text
    bare = _IN_QUERY.sub(r"\1", _IN_AUTHORITY.sub(r"\1@", text))
    return re.sub(r"(?<=[?&])(?:ssl)?password=(?:&|$)", "", bare, flags=re.IGNORECASE).rstrip("?&")
