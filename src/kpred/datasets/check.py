"""What a data set has and what it lacks, in numbers and names."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Issue:
    """Something that is not there or is broken.

    Attributes:
        what: what kind of thing, as `model` or `scan`; name: which one; why: one sentence with the mend.
    """

    what: str
    name: str
    why: str


@dataclass(frozen=True)
class Check:
    """What was found of a data set.

    Attributes:
        kind: of the data set; path: where it lies.
        found: number of things that are there, by category and split (or another word for what they are).
        issues: what is missing or broken.
        remarks: sentences that are worth knowing and no fault.
    """

    kind: str
    path: str
    found: dict[str, dict[str, int]] = field(default_factory=dict)
    issues: tuple[Issue, ...] = ()
    remarks: tuple[str, ...] = ()

    @property
    def complete(self) -> bool:
        """Whether nothing is missing."""
        return not self.issues

    def to_json(self) -> dict[str, Any]:
        """Return plain values."""
        return {
            "kind": self.kind,
            "path": self.path,
            "complete": self.complete,
            "found": self.found,
            "issues": [vars(issue) for issue in self.issues],
            "remarks": list(self.remarks),
        }


def counted(pairs: Iterable[tuple[str, str]]) -> dict[str, dict[str, int]]:
    """Count each (category, split), both in the order of their names."""
    counts: dict[str, dict[str, int]] = {}
    for category, split in sorted(pairs):
        row = counts.setdefault(category, {})
        row[split] = row.get(split, 0) + 1
    return counts
