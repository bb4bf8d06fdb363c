"""Whom and what an exported model names: id, title, author, licence, source, and that it was changed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from kpred._version import __version__

_NAMED = ("title", "author", "licence", "source")


@dataclass(frozen=True)
class Credit:
    """What is written into a file of a result.

    Attributes:
        model_id, category: of the model; details: what its database says of it.
        changes: what was done to it; facts: further entries for formats that take any, such as the confidence.
    """

    model_id: str
    category: str
    details: Mapping[str, str]
    changes: str
    facts: Mapping[str, Any] = field(default_factory=dict)

    def lines(self) -> tuple[str, ...]:
        """Write one line a fact, for comments."""
        known = [f"{key}: {self.details[key]}" for key in _NAMED if self.details.get(key)]
        lines = [f"model: {self.model_id} ({self.category})", *known, f"changes: {self.all_changes()}"]
        return tuple("".join(one if one.isprintable() else " " for one in line) for line in lines)

    def asset(self) -> dict[str, Any]:
        """Entries of the `asset` of a glTF file."""
        named = {key: self.details[key] for key in _NAMED if self.details.get(key)}
        extras = {"model_id": self.model_id, "category": self.category, **named, "changes": self.all_changes()}
        entries: dict[str, Any] = {"generator": f"kpred {__version__}", "extras": extras | dict(self.facts)}
        owner = ", ".join(self.details[key] for key in ("author", "licence") if self.details.get(key))
        return entries | ({"copyright": owner} if owner else {})

    def all_changes(self) -> str:
        """Name the changes of the catalogue, if it names any, and those of kpred."""
        return "; ".join(filter(None, (self.details.get("changes", ""), f"{self.changes} by kpred {__version__}")))
