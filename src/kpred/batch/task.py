"""Scans to be fitted: from a folder or a Parquet manifest, one at a time."""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from kpred.errors import ManifestError
from kpred.shapes.manifest import read_manifest
from kpred.shapes.scan import SCAN_EXTENSIONS

MAX_RECORD = 10_000_000
"""Bytes of a record; a larger file of its name is none."""


@dataclass(frozen=True)
class Task:
    """One scan.

    Attributes:
        name: unique in the batch; path: the file, None where the manifest's row is broken.
        category: of the object; None where it is to be found.
        problem: why it cannot be fitted, from the manifest; empty otherwise.
        place: where its results lie below the output folder, without extension, in a small batch; empty in others.
    """

    name: str
    path: str | None
    category: str | None = None
    problem: str = ""
    place: str = ""

    @property
    def stem(self) -> str:
        """Where its results lie below the output folder, without extension: readable, short and unique."""
        if self.place:
            return self.place
        digest = hashlib.sha256(self.name.encode("utf-8", "surrogatepass")).hexdigest()
        readable = re.sub(r"[^A-Za-z0-9_.-]+", "_", Path(self.name).stem)[:48].lstrip(".") or "scan"
        return f"{digest[:2]}/{readable}-{digest[:16]}"


def read_tasks(source: str | os.PathLike[str]) -> Iterator[Task]:
    """Yield the scans of a folder (recursively, by name) or of a Parquet manifest; see `kpred.shapes.manifest`.

    Raises:
        ManifestError: no such folder or file, no scan in it, or no manifest.
    """
    root = Path(source)
    if root.is_dir():
        return _of_folder(root)
    return _of_manifest(root)


def _of_folder(root: Path) -> Iterator[Task]:
    found = False
    for folder, folders, files in os.walk(root):
        folders[:] = sorted(_searched(folder, folders))
        for name in sorted(files):
            if Path(name).suffix.lower() in SCAN_EXTENSIONS and not is_made(Path(folder), name):
                found = True
                path = Path(folder) / name
                yield Task(path.relative_to(root).as_posix(), str(path))
    if not found:
        others = other_files(root)
        held = f" (it holds {', '.join(f'{count} {kind}' for kind, count in others.items())})" if others else ""
        raise ManifestError(f"{root}: there are no scans in it{held}; put {', '.join(SCAN_EXTENSIONS)} files there.")


def other_files(root: Path) -> dict[str, int]:
    """Count the files of a folder, and of the folders in it, that are no scans, by their extension."""
    counts: Counter[str] = Counter()
    for folder, folders, files in os.walk(root):
        folders[:] = _searched(folder, folders)
        left = (name for name in files if not is_made(Path(folder), name))
        kinds = (Path(name).suffix.lower() or "without extension" for name in left)
        counts.update(kind for kind in kinds if kind not in SCAN_EXTENSIONS)
    return dict(sorted(counts.items()))


def _searched(folder: str, folders: list[str]) -> list[str]:
    """Leave out hidden folders, and the output folders of batches."""
    return [name for name in folders if not name.startswith(".") and not is_output(Path(folder, name))]


def is_output(folder: Path) -> bool:
    """Find out whether a folder holds the results of a batch."""
    return (folder / "job.json").is_file() and (folder / "results.jsonl").is_file()


def is_made(folder: Path, name: str) -> bool:
    """Find out whether a file is hidden, a record of kpred, or lies beside its record: a mesh or a picture."""
    if name.startswith("."):
        return True
    record = folder / f"{Path(name).stem}.json"
    try:
        if not record.is_file() or record.stat().st_size > MAX_RECORD:
            return False
        content = json.loads(record.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return False
    if not isinstance(content, dict) or "kpred" not in content:
        return False
    made = {record.name, f"{record.stem}.png", Path(str(content.get("mesh"))).name}
    return name in made


def _of_manifest(file: Path) -> Iterator[Task]:
    # Digests instead of names: 16 bytes a row are held, whatever the names are.
    seen: set[bytes] = set()
    for row in read_manifest(file):
        name, problem = row.name, row.problem
        digest = hashlib.sha256(name.encode("utf-8", "surrogatepass")).digest()[:16]
        if digest in seen:
            name = f"{name} (row {row.number})"
            problem = problem or f"row {row.number} of {file.name} has the id of an earlier one"
        seen.add(digest)
        yield Task(name, None if row.path is None else str(row.path), row.category, problem)
