"""ModelNet (10, 40) as it is downloaded: OFF files by class and split.

    ROOT/<class>/train/<class>_0001.off    z up; the aligned releases face one way within a class
    ROOT/<class>/test/<class>_0890.off

There is no split to retrieve from: a fixed fraction of `train`, drawn by the model's name, is `source`. `test` stays.
Which way a class faces is not part of the layout; the files are turned to y up and not about it.
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from kpred.datasets.check import Check, Issue
from kpred.datasets.dataset import ShapeFile, found_in
from kpred.errors import PackError
from kpred.shapes.categories import category_of

SPLITS = ("train", "test")
SOURCE_FRACTION = 0.15


@dataclass(frozen=True)
class ModelNet:
    """ModelNet's folder; with `category` only the classes that mean it (`desk` and `table` are both tables)."""

    path: Path
    category: str | None = None
    kind: str = "modelnet"

    def shapes(self) -> Sequence[ShapeFile]:
        """See `Dataset`."""
        found = [shape for folder in self._classes() for shape in _shapes(folder)]
        if not found:
            raise PackError(f"{self.path}: no class has .off files in train or test; give ModelNet's own folder.")
        return found

    def check(self) -> Check:
        """See `Dataset`."""
        issues = []
        for folder in self._classes():
            for split in SPLITS:
                if not any((folder / split).glob("*.off")):
                    why = f"{folder / split} has no .off file; unpack the archive again"
                    issues.append(Issue("split", f"{folder.name}/{split}", why))
        found = [shape for folder in self._classes() for shape in _shapes(folder)]
        remark = f"{SOURCE_FRACTION:.0%} of train are source; which way the classes face is not known"
        return Check(self.kind, str(self.path), found_in(found), tuple(issues), (remark,))

    def _classes(self) -> list[Path]:
        if not self.path.is_dir():
            raise PackError(f"{self.path}: there is no such folder; give ModelNet's own folder.")
        folders = [f for f in sorted(self.path.iterdir()) if any((f / split).is_dir() for split in SPLITS)]
        return [f for f in folders if self.category in (None, category_of(f.name))]


def is_modelnet(path: Path) -> bool:
    """Test whether a folder has ModelNet's layout."""
    return any(path.glob("*/train/*.off")) or any(path.glob("*/test/*.off"))


def _shapes(folder: Path) -> list[ShapeFile]:
    found = []
    for split in SPLITS:
        for file in sorted((folder / split).glob("*.off")):
            drawn = split == "train" and zlib.crc32(file.stem.encode()) / 2**32 < SOURCE_FRACTION
            found.append(ShapeFile(file.stem, category_of(folder.name), "source" if drawn else split, file, "z_up"))
    return found
