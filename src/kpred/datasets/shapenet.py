"""ShapeNet meshes with a split file (synsetId, modelId, split), as KP-RED's split of PartNet shapes.

    ROOT/<synset>/<model>/models/model_normalized.obj    ShapeNetCore.v2: y up, front -z
    ROOT/<synset>/<model>/model.obj                      ShapeNetCore.v1: y up, front -z
    split.csv                                            columns synsetId, modelId, split; others are ignored

The split is one of source (retrieved from and deformed), train, val, test.
"""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from kpred.datasets.check import Check, Issue
from kpred.datasets.dataset import ShapeFile, found_in
from kpred.errors import PackError
from kpred.shapes.categories import category_of

COLUMNS = ("synsetId", "modelId", "split")
SPLITS = ("source", "train", "val", "test")
FILES = (Path("models") / "model_normalized.obj", Path("model.obj"))


@dataclass(frozen=True)
class SplitRow:
    """One line of a split file: synset (eight digits), model id, split."""

    synset: str
    model_id: str
    split: str


def read_split(file: Path) -> list[SplitRow]:
    """Read the lines of a split file, in their order.

    Raises:
        PackError: the file is missing or unreadable, lacks a column, has a line that is not one of the splits, or
            names a model twice with different splits.
    """
    try:
        with open(file, encoding="utf-8-sig", newline="") as stream:
            reader = csv.DictReader(stream, skipinitialspace=True)
            missing = [name for name in COLUMNS if name not in (reader.fieldnames or ())]
            if missing:
                raise PackError(f"{file}: it lacks the column {missing[0]}; a split file has {', '.join(COLUMNS)}.")
            rows = []
            for row in reader:
                synset, model_id, split = ((row[name] or "").strip() for name in COLUMNS)
                if not (synset.isdigit() and model_id and split in SPLITS):
                    raise PackError(
                        f"{file}: line {reader.line_num} ({synset}, {model_id}, {split}) is not a synset, a model and "
                        f"one of {', '.join(SPLITS)}; mend it."
                    )
                # Spreadsheets drop the zeros that synsets begin with.
                rows.append(SplitRow(synset.zfill(8), model_id, split))
    except OSError as error:
        raise PackError(f"{file}: it cannot be read ({error.strerror or error}); give the split's csv.") from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise PackError(f"{file}: it is not a csv file; give the split's csv.") from error
    splits: dict[tuple[str, str], str] = {}
    for line in rows:
        if splits.setdefault((line.synset, line.model_id), line.split) != line.split:
            raise PackError(f"{file}: {line.synset}/{line.model_id} is in two splits; leave it in one.")
    return [SplitRow(synset, model_id, split) for (synset, model_id), split in splits.items()]


@dataclass(frozen=True)
class ShapeNet:
    """ShapeNet meshes and their split.

    Attributes:
        path: folder of the synsets; split_file: the csv.
        category: only models of this category count; None takes all that the split names.
    """

    path: Path
    split_file: Path
    category: str | None = None
    kind: str = "shapenet"

    def shapes(self) -> Sequence[ShapeFile]:
        """See `Dataset`."""
        found, _ = self._sorted()
        if not found:
            raise PackError(f"{self.path}: no model of {self.split_file} is in it; give the folder of the synsets.")
        return found

    def check(self) -> Check:
        """See `Dataset`."""
        found, absent = self._sorted()
        issues = []
        # A synset of which nothing is there is one lack, not thousands.
        whole = {row.synset for row in absent if not (self.path / row.synset).is_dir()}
        for synset, count in sorted(Counter(row.synset for row in absent if row.synset in whole).items()):
            why = f"{self.path / synset} is not there ({count} models of the split); download it"
            issues.append(Issue("synset", f"{synset} ({category_of(synset)})", why))
        for row in absent:
            if row.synset not in whole:
                why = f"{self.path / row.synset / row.model_id / FILES[0]} is not there ({row.split}); download it"
                issues.append(Issue("model", f"{row.synset}/{row.model_id}", why))
        known = {shape.path.relative_to(self.path).parts[:2] for shape in found}
        known |= {(row.synset, row.model_id) for row in absent}
        others = sum(
            (folder.parent.name, folder.name) not in known
            for synset in {row[0] for row in known}
            if (self.path / synset).is_dir()
            for folder in (self.path / synset).iterdir()
            if folder.is_dir()
        )
        remarks = (f"{others} models that are there are not in the split and are left out",) if others else ()
        return Check(self.kind, str(self.path), found_in(found), tuple(issues), remarks)

    def _sorted(self) -> tuple[list[ShapeFile], list[SplitRow]]:
        """List the models of the split that are present, and those that are missing."""
        if not self.path.is_dir():
            raise PackError(f"{self.path}: there is no such folder; give the folder of ShapeNet's synsets.")
        found: list[ShapeFile] = []
        absent: list[SplitRow] = []
        for row in read_split(self.split_file):
            category = category_of(row.synset)
            if self.category not in (None, category):
                continue
            folder = self.path / row.synset / row.model_id
            file = next((folder / name for name in FILES if (folder / name).is_file()), None)
            if file is None:
                absent.append(row)
            else:
                found.append(ShapeFile(row.model_id, category, row.split, file, "half"))
        return found, absent
