"""Which data set a path holds."""

from __future__ import annotations

import os
from pathlib import Path

from kpred.datasets.dataset import Dataset
from kpred.datasets.files import Folder, Packs
from kpred.datasets.modelnet import ModelNet, is_modelnet
from kpred.datasets.scan2cad import ANNOTATIONS, Scan2Cad
from kpred.datasets.shapenet import ShapeNet
from kpred.errors import ConfigError, PackError

KINDS = ("shapenet", "scan2cad", "modelnet", "packs", "folder")


def open_dataset(
    path: str | os.PathLike[str],
    kind: str | None = None,
    *,
    split_file: str | os.PathLike[str] | None = None,
    scannet: str | os.PathLike[str] | None = None,
    shapenet: str | os.PathLike[str] | None = None,
    category: str | None = None,
) -> Dataset:
    """Open the data set at a path, without reading its files.

    Args:
        kind: its layout, one of `KINDS`; None goes by what is there.
        split_file: ShapeNet's split (csv); needed for `shapenet`, and means it where no kind is named.
        scannet, shapenet: for `scan2cad`, where scans and models lie elsewhere.
        category: only shapes of this category.

    Raises:
        PackError: there is nothing at the path.
        ConfigError: an unknown kind, or a missing split file.
    """
    root = Path(path)
    if not root.exists():
        raise PackError(f"{root}: there is no such file or folder; check the path.")
    named = kind or _guessed(root, split_file is not None)
    if named == "shapenet":
        if split_file is None:
            raise ConfigError(
                f"{root}: ShapeNet needs a split file (synsetId, modelId, split); name it by --split-file."
            )
        return ShapeNet(root, Path(split_file), category)
    if named == "scan2cad":
        return Scan2Cad(root, _path(scannet), _path(shapenet), category)
    if named == "modelnet":
        return ModelNet(root, category)
    if named == "packs":
        return Packs(root, category)
    if named == "folder":
        return Folder(root, category)
    raise ConfigError(f"There is no kind of data set '{named}'; choose one of {', '.join(KINDS)}.")


def _guessed(root: Path, has_split: bool) -> str:
    if has_split:
        return "shapenet"
    if root.is_file():
        if root.suffix.lower() == ".npz":
            return "packs"
        raise PackError(f"{root}: it is no mesh pack (.npz) and no folder; give one of them.")
    if (root / ANNOTATIONS).is_file():
        return "scan2cad"
    if any(root.glob("*.npz")):
        return "packs"
    return "modelnet" if is_modelnet(root) else "folder"


def _path(value: str | os.PathLike[str] | None) -> Path | None:
    return None if value is None else Path(value)
