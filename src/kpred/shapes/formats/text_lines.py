"""Lines of text files as a program wrote them: in UTF-8, UTF-16 or UTF-32, ended by line feeds or returns."""

from __future__ import annotations

import codecs
import io
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

_SAMPLE = 65536
_MARKS = (
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)


@contextmanager
def open_lines(path: Path) -> Iterator[Iterable[bytes]]:
    """Open a text file as UTF-8 lines that end in a line feed, without a byte order mark.

    Files of one byte a character are read as they are, whatever their encoding; only lone carriage returns become line
    feeds.
    """
    with open(path, "rb") as stream:
        sample = stream.read(_SAMPLE)
        encoding = text_encoding(sample)
        marked = sample.startswith(codecs.BOM_UTF8)
        stream.seek(len(codecs.BOM_UTF8) if marked else 0)
        returns = sample.count(b"\r") - sample.count(b"\r\n")
        if encoding is None and returns <= sample.count(b"\n"):
            yield stream
            return
        wrapped = io.TextIOWrapper(stream, encoding=encoding or "latin-1", errors="replace", newline=None)
        yield (line.encode("latin-1" if encoding is None else "utf-8") for line in wrapped)


def text_encoding(sample: bytes) -> str | None:
    """Detect UTF-16 and UTF-32 from the first bytes of a file; None means one byte a character."""
    for mark, encoding in _MARKS:
        if sample.startswith(mark):
            return encoding
    # Without a mark: Latin text in UTF-16 has a zero at every second byte, and nowhere else.
    even, odd = sample[0:1024:2], sample[1:1024:2]
    if len(odd) >= 2 and not any(odd) and all(even):
        return "utf-16-le"
    if len(even) >= 2 and not any(even) and all(odd):
        return "utf-16-be"
    return None
