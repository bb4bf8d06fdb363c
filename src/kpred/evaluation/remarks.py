"""Sentences about what a measurement leaves out: reported at once, and kept for its header."""

from __future__ import annotations

from collections.abc import Callable


class Remarks:
    """Sentences in the order they came in.

    Attributes:
        sentences: all so far.
    """

    def __init__(self, report: Callable[[str], None], unique: bool = False) -> None:
        """Begin without remarks; `report` is called with each, `unique` leaves out repeated ones."""
        self.sentences: list[str] = []
        self._report, self._unique = report, unique

    def __call__(self, sentence: str) -> None:
        """Add a remark."""
        if self._unique and sentence in self.sentences:
            return
        self.sentences.append(sentence)
        self._report(sentence)
