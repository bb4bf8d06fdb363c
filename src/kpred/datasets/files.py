"""Data sets that need no split file: mesh packs, and any folder of meshes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kpred.datasets.check import Check, Issue, counted
from kpred.datasets.dataset import ShapeFile, found_in
from kpred.errors import MeshError, PackError
from kpred.shapes.folder import read_folder
from kpred.shapes.pack import MeshPack


@dataclass(frozen=True)
class Folder:
    """Any folder of mesh files, all of them `source`; layouts as in `kpred.shapes.folder.read_folder`."""

    path: Path
    category: str | None = None
    kind: str = "folder"

    def shapes(self) -> Sequence[ShapeFile]:
        """See `Dataset`."""
        try:
            items = read_folder(self.path, self.category)
        except MeshError as error:
            raise PackError(str(error)) from error
        return [
            ShapeFile(item.model_id, item.category, "source", item.path, "half" if item.faces_back else "none")
            for item in items
        ]

    def check(self) -> Check:
        """See `Dataset`."""
        return Check(self.kind, str(self.path), found_in(self.shapes()))


@dataclass(frozen=True)
class Packs:
    """A mesh pack (.npz) or a folder of them: prepared already, as those of `kpred data generate`."""

    path: Path
    category: str | None = None
    kind: str = "packs"

    def shapes(self) -> Sequence[ShapeFile]:
        """See `Dataset`."""
        raise PackError(f"{self.path}: mesh packs are prepared already; give them to the command that wants packs.")

    def check(self) -> Check:
        """See `Dataset`; here the shapes are read too, since they all lie in one file."""
        files = sorted(self.path.glob("*.npz")) if self.path.is_dir() else [self.path]
        pairs: list[tuple[str, str]] = []
        issues: list[Issue] = []
        remarks: list[str] = []
        for file in files:
            try:
                pack = MeshPack.load(file)
            except PackError as error:
                issues.append(Issue("pack", file.name, str(error)))
                continue
            if self.category not in (None, pack.category):
                continue
            pairs += [(pack.category, str(split)) for split in pack.split]
            issues += [Issue("shape", *found) for found in _broken(pack, file)]
            if not len(pack.indices("source")):
                remarks.append(f"{file.name} has no split source: it can be measured only against a database")
        return Check(self.kind, str(self.path), counted(pairs), tuple(issues), tuple(remarks))


def _broken(pack: MeshPack, file: Path) -> list[tuple[str, str]]:
    """List shapes without a surface or with a duplicate name, and the reason."""
    found = []
    names, counts = np.unique(pack.model_id, return_counts=True)
    for name in names[counts > 1]:
        found.append((str(name), f"{file}: several shapes are called {name}; write the pack again with names apart"))
    for mesh in pack:
        areas = mesh.face_areas()
        if not (np.isfinite(areas) & (areas > 0)).any():
            found.append((mesh.name, f"{file}: {mesh.name} has no face with an area; it is left out where it is used"))
    return found
