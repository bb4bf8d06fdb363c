"""A printed table: what a command shows, and decides nothing about."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Page:
    """A title, headings, and rows of text and numbers; numbers are None where there are none."""

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[object]]


def brief(sentences: Iterable[str], count: int) -> Iterator[str]:
    """Yield the first sentences of many, and then how many more there are."""
    every = list(sentences)
    yield from every[:count]
    if len(every) > count:
        yield f"and {len(every) - count} more"


def with_interval(value: float, low: float | None, high: float | None, digits: int) -> str:
    """Write a value and, in parentheses, its 95 % interval."""
    if low is None or high is None:
        return f"{value:.{digits}f}"
    return f"{value:.{digits}f} ({low:.{digits}f}–{high:.{digits}f})"
