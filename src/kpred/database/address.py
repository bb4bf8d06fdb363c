"""Addresses of database servers, and how they are shown and stored: without their passwords."""

from __future__ import annotations

import os
import re
from urllib.parse import unquote

from kpred.errors import DatabaseError

_ADDRESS = re.compile(r"postgres(ql)?(\+\w+)?:/", re.IGNORECASE)
_OTHER = re.compile(r"[a-z][a-z0-9+.-]+:/|(?:host|hostaddr|dbname|user|password|service)\s*=", re.IGNORECASE)
# Any scheme: a mistyped one has a password too. A password with blanks ends before the next / or :.
_IN_AUTHORITY = re.compile(r"([a-z][a-z0-9+.-]*:/+[^:/@\s]*):(?:\S*|[^/:@\n]*)@", re.IGNORECASE)
_IN_QUERY = re.compile(
    r"""([^\s=&?;'"#]{1,200})(\s*=\s*)('(?:\\.|[^'\\])*'|"(?:\\.|[^"\\])*"|(?:\\.|[^&\s'"]|['"](?![,}\])\s:]|$))*)"""
)
"""A key, which may be percent-encoded, and its value, which may be quoted."""

_SECRETS = ("password", "pwd", "passwd", "secret", "scram_client_key", "scram_server_key")
"""Ends of keys whose values are not shown."""

_LOGIN = re.compile(r"(\blogin\s+\S+\s+password\s+)(\S+)", re.IGNORECASE)
_PASS_FILE = re.compile(r"(?<![\w/.:-])((?:[\w.*-]+):(?:\d{2,5}|\*):[^:\s@/]+:[^:\s@/]+:)([^\s:]+)(?!\S)")
"""Lines of ~/.netrc and ~/.pgpass."""


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
    shown = _IN_QUERY.sub(_masked_value, _IN_AUTHORITY.sub(r"\1:***@", os.fspath(text)))
    return _PASS_FILE.sub(r"\1***", _LOGIN.sub(r"\1***", shown))


def without_password(place: str | os.PathLike[str]) -> str:
    """Drop the password of an address; a file name stays as it is."""
    text = os.fspath(place)
    if not is_address(text):
        return text
    bare, mark, query = _IN_AUTHORITY.sub(r"\1@", text).partition("?")
    kept = [entry for entry in query.split("&") if entry and not _is_secret(entry.partition("=")[0])]
    return bare + (mark + "&".join(kept) if kept else "")


def _masked_value(match: re.Match[str]) -> str:
    return f"{match[1]}{match[2]}***" if _is_secret(match[1]) and match[3] else match[0]


def _is_secret(key: str) -> bool:
    """Test whether a key, percent-encoded or not, names a password."""
    return unquote(key).lower().endswith(_SECRETS)
