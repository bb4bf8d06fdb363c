"""The frame of every report: one HTML page with its own style and scripts, which loads nothing from elsewhere."""

from __future__ import annotations

import base64
import hashlib
import os
from collections.abc import Iterable, Sequence
from html import escape
from importlib import resources
from pathlib import Path

from kpred._version import __version__
from kpred.atomic import atomic_path, check_place
from kpred.errors import OutputError


def text_of(value: object) -> str:
    """Return a value as HTML text: names of files and models may hold markup, control characters or no Unicode."""
    shown = "".join(one if one.isprintable() else ascii(one)[1:-1] for one in str(value))
    return escape(shown)


def tag(name: str, content: str = "", **attributes: object) -> str:
    """Return an element around HTML; `class_` is written as class, and `data_key` as data-key."""
    written = "".join(
        f' {key.rstrip("_").replace("_", "-")}="{text_of(value)}"' for key, value in attributes.items() if value != ""
    )
    return f"<{name}{written}>{content}</{name}>"


def section(title: str, *parts: str) -> str:
    """Return parts under a heading; nothing where all are empty."""
    content = "".join(parts)
    return tag("section", tag("h2", text_of(title)) + content) if content else ""


def warning_list(sentences: Iterable[str]) -> str:
    """List sentences about what may be wrong; nothing where there are none."""
    items = "".join(tag("li", text_of(sentence)) for sentence in sentences)
    return tag("ul", items, class_="warnings") if items else ""


def page(title: str, parts: Sequence[str], scripts: Sequence[str] = ()) -> str:
    """Return a whole page.

    Args:
        title: plain text; parts: HTML below it.
        scripts: names of scripts of this package; no others run, whatever the parts hold.
    """
    codes = [_file(name) for name in scripts]
    hashes = " ".join(f"'sha256-{_hash(code)}'" for code in codes) or "'none'"
    policy = f"default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src {hashes}"
    head = (
        '<meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{text_of(title)}</title><style>{_file('report.css')}</style>"
    )
    body = "\n".join([tag("h1", text_of(title)), *parts, tag("footer", f"kpred {text_of(__version__)}")])
    ends = "".join(f"<script>{code}</script>" for code in codes)
    return f'<!doctype html>\n<html lang="en"><head>{head}</head>\n<body><main>\n{body}\n</main>{ends}</body></html>\n'


def check_report(path: str | os.PathLike[str]) -> Path:
    """Refuse a place for a report before any work is done for it.

    Raises:
        OutputError: the extension is not .html, or the file cannot be written there.
    """
    file = Path(path)
    if file.suffix.lower() != ".html":
        raise OutputError(f"Cannot write {file}: reports are .html files; give it that extension.")
    check_place(file)
    return file


def save_report(path: str | os.PathLike[str], text: str) -> None:
    """Write a page, whole or not at all.

    Raises:
        OutputError: the file cannot be written there.
    """
    with atomic_path(check_report(path)) as temporary:
        temporary.write_text(text, encoding="utf-8")


def _file(name: str) -> str:
    return resources.files("kpred.reports").joinpath(name).read_text(encoding="utf-8").strip()


def _hash(code: str) -> str:
    return base64.b64encode(hashlib.sha256(code.encode()).digest()).decode()
