"""Lists of targets in files: the targets of another table, a split file in CSV, or one id a line."""

from __future__ import annotations

import csv
import os
from collections.abc import Sequence
from pathlib import Path

from kpred.errors import PackError
from kpred.evaluation.tables.table import read_table

_ID_COLUMNS = ("modelId", "model_id", "id")
_SHOWN = 20


def read_target_list(path: str | os.PathLike[str], split: str) -> frozenset[str]:
    """Ids of targets.

    A `.json` file is a table of `kpred evaluate table`: its targets. A `.csv` file has a column `modelId` or `model_id`
    (the paper's split file has synsetId, modelId, split) and, if it has a column `split`, only lines of `split` count.
    Any other file has one id a line; empty lines and lines that begin with # do not count.

    Raises:
        PackError: the file is missing, damaged, or names no target.
    """
    file = Path(path)
    if file.suffix.lower() == ".json":
        found = {subject.model_id for subject in read_table(file).subjects()}
    else:
        try:
            text = file.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise PackError(f"{file}: it cannot be read ({error}); give a list of targets.") from error
        found = _of_csv(text, file, split) if file.suffix.lower() == ".csv" else _of_lines(text)
    if not found:
        raise PackError(f"{file}: it names no target of the split '{split}'; choose another split or file.")
    return frozenset(found)


def listed(names: Sequence[str]) -> str:
    """Names in a sentence, the first of many."""
    more = f", and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
    return ", ".join(names[:_SHOWN]) + more + "."


def _of_csv(text: str, file: Path, split: str) -> set[str]:
    reader = csv.DictReader(text.splitlines())
    columns = reader.fieldnames or []
    column = next((name for name in _ID_COLUMNS if name in columns), None)
    if column is None:
        raise PackError(f"{file}: it has no column modelId; its columns are {', '.join(columns) or 'none'}.")
    return {line[column] for line in reader if line[column] and line.get("split", split) == split}


def _of_lines(text: str) -> set[str]:
    lines = (line.strip() for line in text.splitlines())
    return {line for line in lines if line and not line.startswith("#")}
