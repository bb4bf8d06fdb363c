"""Where a command prints: results for people or as JSON, notes and progress beside them."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

from kpred.json_output import json_text

if TYPE_CHECKING:
    from rich.console import Console

_FILE_WIDTH = 140
"""Columns of tables that go to a file or a pipe, where there is no terminal to ask."""


class Output:
    """Standard output belongs to the result: text and tables for people, or one JSON value with ``--json``.

    With ``--json`` everything for people goes to standard error instead, so that standard output can be piped.
    """

    def __init__(self, as_json: bool, command: str = "") -> None:
        """Start the output of one command; `command`: the command line, for records."""
        self.as_json = as_json
        self.command = command
        self._people: Console | None = None

    @property
    def people(self) -> Console:
        """The console for people: standard output, or standard error with ``--json``."""
        if self._people is None:
            from rich.console import Console

            console = Console(stderr=self.as_json, highlight=False, soft_wrap=True)
            if not console.is_terminal:
                console.width = _FILE_WIDTH
            self._people = console
        return self._people

    def note(self, text: str) -> None:
        """Print a line for people; plain text, no markup."""
        self.people.print("\n".join(map(printable, text.split("\n"))), markup=False)

    def caution(self, text: str) -> None:
        """Print a warning about the result to standard error, with or without ``--json``."""
        print(f"kpred: note: {printable(' '.join(text.split()))}", file=sys.stderr)

    def table(self, title: str, columns: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
        """Print a table for people; columns that hold numbers only are set flush right."""
        from rich import box
        from rich.table import Table
        from rich.text import Text

        body = [list(row) for row in rows]
        table = Table(title=Text(printable(title)), title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)
        for number, name in enumerate(columns):
            numeric = bool(body) and all(isinstance(row[number], int | float | None) for row in body)
            table.add_column(Text(name), justify="right" if numeric else "left", overflow="fold")
        for row in body:
            table.add_row(*(Text(_shown(cell)) for cell in row))
        self.people.print(table)

    def result(self, value: Any) -> None:
        """Print the machine-readable result with ``--json``; do nothing without it."""
        if self.as_json:
            sys.stdout.write(json_text(value))
            sys.stdout.flush()


def printable(text: str) -> str:
    """Remove characters that control a terminal, as names of models and files may hold any."""
    return "".join(letter if letter.isprintable() or letter == "\t" else ascii(letter)[1:-1] for letter in text)


def _shown(cell: object) -> str:
    if isinstance(cell, float):
        return f"{cell:.4g}"
    return "" if cell is None else printable(str(cell))
