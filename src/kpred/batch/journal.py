"""Journal of a batch's output folder: the job, finished scans, failed scans; consistent after any kill.

job.json        input and settings; another batch is refused
results.jsonl   a line a scan that is done, in the order they were done
failures.jsonl  a line a scan that was given up, written at the end of each run
a/name.json, .ply   record and mesh of each scan of a small batch, as a/name.* lies in the input folder
3f/name-3f....json, .ply   the same in a large batch; where the record is, the scan is done
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from kpred.atomic import atomic_path
from kpred.batch.task import Task
from kpred.database.address import without_password
from kpred.errors import ManifestError, OutputError
from kpred.json_output import write_json
from kpred.locks import take_lock

_UNFINISHED = re.compile(r"\..+\.\d+\.[0-9a-f]{8}\.\w+")
"""Names of files that are being written (`kpred.atomic`)."""


class Journal:
    """One output folder, held by one run at a time."""

    def __init__(self, folder: Path, job: dict[str, Any], places: Mapping[str, str] | None = None) -> None:
        """Take the folder, made where it does not exist.

        Args:
            places: name -> stem of each scan of a small batch (`kpred.batch.layout`); None where hashes lead to them.

        Raises:
            ManifestError: it belongs to another batch, or another run has it.
            OutputError: it cannot be written.
        """
        self.folder, self.places = folder, places
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._lock = open(folder / ".lock", "a", encoding="ascii")  # noqa: SIM115  held until `close`
        except OSError as error:
            raise OutputError(f"Cannot write into {folder}: {error.strerror}; choose another folder.") from error
        try:
            take_lock(self._lock.fileno())
        except OSError as error:
            self._lock.close()
            raise ManifestError(
                f"{folder}: another run is filling it; wait for it, or choose another folder."
            ) from error
        try:
            self._check_job(job)
            self._remove_unfinished()
            self._done = self._reconcile()
            self._lines = open(folder / "results.jsonl", "a", encoding="utf-8")  # noqa: SIM115  held until `close`
        except BaseException:
            self._lock.close()
            raise

    def __enter__(self) -> Journal:
        return self

    def __exit__(self, *error: object) -> None:
        self._lines.close()
        self._lock.close()

    def __len__(self) -> int:
        return len(self._done)

    def is_done(self, task: Task) -> bool:
        """Test whether the scan's record is there."""
        return task.stem in self._done

    def done(self, task: Task, row: dict[str, Any]) -> None:
        """Note that the scan's record is there; it is noted once."""
        if task.stem in self._done:
            return
        self._done.add(task.stem)
        self._lines.write(json.dumps(row) + "\n")
        self._lines.flush()

    def write_failures(self, failures: Iterable[tuple[str, str]]) -> None:
        """Write (name, reason) of scans that failed in this run, replacing those of earlier runs."""
        with atomic_path(self.folder / "failures.jsonl") as temporary, open(temporary, "w", encoding="utf-8") as file:
            for name, reason in failures:
                file.write(json.dumps({"name": name, "problem": reason}) + "\n")

    def _check_job(self, job: dict[str, Any]) -> None:
        file = self.folder / "job.json"
        try:
            before = json.loads(file.read_text(encoding="utf-8"))
        except FileNotFoundError:
            if self._records():
                raise ManifestError(
                    f"{self.folder}: job.json is missing beside results; choose another folder."
                ) from None
            write_json(file, job, indent=1)
            return
        except (OSError, ValueError, RecursionError) as error:
            raise ManifestError(f"{file} cannot be read; choose another output folder.") from error
        if not isinstance(before, dict):
            raise ManifestError(f"{file} is no job of a batch; choose another output folder.")
        if isinstance(before.get("database"), str):
            stored = before["database"]
            before["database"] = without_password(stored)
            if before["database"] != stored:  # Earlier versions kept it.
                write_json(file, before, indent=1)
        other = [key for key in sorted({*before, *job}) if before.get(key) != job.get(key)]
        if other:
            raise ManifestError(
                f"{self.folder} holds results of another batch ({other[0]} was {before.get(other[0])!r}, "
                f"now {job.get(other[0])!r}); give the same options to go on, or another folder."
            )

    def _remove_unfinished(self) -> None:
        """Remove files that a killed worker was writing: their names begin with a dot."""
        if self.places is None:
            unfinished = list(self.folder.glob("??/.*"))
        else:
            folders = {(self.folder / stem).parent for stem in self.places.values()}
            unfinished = [file for one in folders for file in one.glob(".*.*.*.*") if _UNFINISHED.fullmatch(file.name)]
        for file in unfinished:
            file.unlink(missing_ok=True)

    def _records(self) -> set[str]:
        """Return the stems of the records that are there."""
        if self.places is None:
            return {f"{file.parent.name}/{file.stem}" for file in self.folder.glob("??/[!.]*-*.json")}
        return {stem for stem in self.places.values() if (self.folder / f"{stem}.json").is_file()}

    def _stem(self, name: str) -> str:
        return Task(name, None).stem if self.places is None else self.places.get(name, "")

    def _reconcile(self) -> set[str]:
        """Bring `results.jsonl` in line with the records, and return the stems of these."""
        records = self._records()
        file = self.folder / "results.jsonl"
        noted: dict[str, str] = {}
        whole = True
        for line, row in _lines(file):
            whole = whole and row is not None and line.endswith("\n")
            if row is not None and self._stem(row["name"]) in records:
                noted.setdefault(self._stem(row["name"]), json.dumps(row))
            else:
                whole = False
        missing = sorted(records - noted.keys())
        if missing or not whole:
            for stem in missing:
                try:
                    row = json.loads((self.folder / f"{stem}.json").read_text(encoding="utf-8"))["batch"]
                except (OSError, ValueError, KeyError):
                    records.discard(stem)  # damaged from outside: it is fitted again
                    continue
                noted[stem] = json.dumps(row)
            with atomic_path(file) as temporary:
                temporary.write_text("".join(f"{line}\n" for line in noted.values()), encoding="utf-8")
        return records


def _lines(file: Path) -> Iterator[tuple[str, dict[str, Any] | None]]:
    """Yield lines with their parsed row, or None where a line is no complete row."""
    if not os.path.exists(file):
        return
    with open(file, encoding="utf-8", errors="replace") as stream:
        for line in stream:
            try:
                row = json.loads(line)
                yield line, row if isinstance(row, dict) and isinstance(row.get("name"), str) else None
            except ValueError:
                yield line, None
