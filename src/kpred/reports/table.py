"""Tables of reports: names beside values, and rows that a click on a heading sorts (`sort.js`)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from kpred.reports.page import tag, text_of

Value = str | int | float | None


@dataclass(frozen=True)
class Html:
    """A cell that is HTML already; `key`: what it is sorted by."""

    content: str
    key: Value = ""


def facts(rows: Iterable[tuple[str, Value | Html]]) -> str:
    """Return a table of names beside their values, without those that are None or empty."""
    lines = "".join(
        tag("tr", tag("th", text_of(name), scope="row") + tag("td", _cell(value)))
        for name, value in rows
        if value is not None and value != ""
    )
    return tag("table", lines, class_="facts") if lines else ""


def sortable(columns: Sequence[str], rows: Iterable[Sequence[Value | Html]], classes: Sequence[str] = ()) -> str:
    """Return a table whose rows a click on a heading sorts; numbers by size, all else as text.

    Args:
        classes: CSS class of each row.
    """
    head = "".join(tag("th", text_of(name), scope="col") for name in columns)
    lines = []
    for number, row in enumerate(rows):
        cells = "".join(
            tag("td", _cell(value), data_key=_key(value), class_="number" if _is_number(value) else "") for value in row
        )
        lines.append(tag("tr", cells, class_=classes[number] if classes else ""))
    body = tag("tbody", "\n".join(lines))
    return tag("div", tag("table", tag("thead", tag("tr", head)) + body, class_="sortable"), class_="wide")


def shown(value: Value) -> str:
    """Return a value as people read it: floats with four digits."""
    return "" if value is None else f"{value:.4g}" if isinstance(value, float) else str(value)


def meter(fraction: float) -> Html:
    """Return a probability as a number with a bar."""
    width = 100 * min(max(fraction, 0.0), 1.0)
    kind = "good" if fraction >= 0.8 else "fair" if fraction >= 0.5 else "poor"
    bar = tag("i", class_=kind, style=f"width:{width:.0f}%")
    return Html(tag("span", bar, class_="meter") + f"{fraction:.2f}", fraction)


def _cell(value: Value | Html) -> str:
    return value.content if isinstance(value, Html) else text_of(shown(value))


def _key(value: Value | Html) -> Value:
    key = value.key if isinstance(value, Html) else value
    return "" if key is None else key


def _is_number(value: Value | Html) -> bool:
    key = value.key if isinstance(value, Html) else value
    return isinstance(key, int | float)
