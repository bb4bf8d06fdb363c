"""Where the results of a batch lie: small batches as their scans lie, large ones in folders of hashes."""

from __future__ import annotations

import hashlib
import json
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, islice
from pathlib import Path, PurePosixPath

from kpred.batch.task import Task
from kpred.errors import ManifestError

SMALL = 1000
"""A batch of no more scans has its results beside each other, as its scans are."""

RESERVED = {"job", "results", "failures"}
"""Names of the journal's own files."""


@dataclass(frozen=True)
class Layout:
    """Layout of an output folder.

    Attributes:
        places: name -> stem of each scan of a small batch; None where folders of hashes hold the results.
    """

    places: Mapping[str, str] | None

    @property
    def job(self) -> dict[str, str]:
        """What the job's file says of it; folders of hashes, as earlier versions had them, are not named."""
        return {} if self.places is None else {"layout": "names"}


def lay_out(tasks: Iterator[Task], out: Path, source: Path, small: int = SMALL) -> tuple[Layout, Iterator[Task]]:
    """Choose the layout of a batch, that of the run that began it, and give each scan its place.

    `small`: number of scans up to which a batch is small.

    Raises:
        ManifestError: no scans; or results would lie among the scans.
    """
    first = list(islice(tasks, small + 1))
    before = _begun(out)
    if before == "hashes" or (before is None and len(first) > small):
        return Layout(None), chain(first, tasks)
    if out == source:
        raise ManifestError(f"{out}: results would lie among the scans; give another folder, as {out / 'fitted'}.")
    every = [*first, *tasks]
    places = name_places([task.name for task in every])
    return Layout(places), (replace(task, place=places[task.name]) for task in every)


def name_places(names: Sequence[str]) -> dict[str, str]:
    """Map names to stems, all of them different: the name without extension, and a hash where that is not unique."""
    plain = {name: _stem(name) for name in names}
    # Some file systems know no difference of capital letters.
    counts = Counter(stem.lower() for stem in plain.values())
    found = {}
    for name, stem in plain.items():
        if counts[stem.lower()] > 1 or stem.lower() in RESERVED:
            digest = hashlib.sha256(name.encode("utf-8", "surrogatepass")).hexdigest()
            found[name] = f"{stem}-{digest[:12]}"
        else:
            found[name] = stem
    return found


def _stem(name: str) -> str:
    parts = [re.sub(r"[^A-Za-z0-9_. -]+", "_", part)[:100].strip(" .") for part in PurePosixPath(name).parts]
    kept = [part for part in parts if part and part != "_"] or ["scan"]
    suffix = PurePosixPath(kept[-1]).suffix
    return "/".join([*kept[:-1], kept[-1].removesuffix(suffix) or "scan"])


def _begun(out: Path) -> str | None:
    """Return the layout of the batch that an output folder holds: `names` or `hashes`; None where there is none."""
    try:
        job = json.loads((out / "job.json").read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return None
    return "names" if isinstance(job, dict) and job.get("layout") == "names" else "hashes"
