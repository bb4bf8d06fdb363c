"""Shapes from wherever they are: a mesh pack, a folder of packs or of mesh files, or a manifest."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple

from kpred.errors import MeshError, PackError
from kpred.shapes.folder import FolderItem, read_folder
from kpred.shapes.manifest import MANIFEST_EXTENSIONS, folder_manifest, read_manifest
from kpred.shapes.mesh import Mesh, clean_mesh
from kpred.shapes.pack import MeshPack
from kpred.shapes.upright_mesh import stand_mesh

if TYPE_CHECKING:
    from kpred.shapes.appearance.appearance import Appearance
    from kpred.shapes.appearance.read import Stand


class Shape(NamedTuple):
    """One shape of a source: y up, front +z; split is source, train or val.

    `details`: what a manifest says of it, by column (title, author, licence, source, width, ...); `appearance`: what
    its file holds beside positions, where it is wanted.
    """

    model_id: str
    category: str
    split: str
    mesh: Mesh
    details: Mapping[str, str] = MappingProxyType({})
    appearance: Appearance | None = None


def warn(message: str) -> None:
    """Report a sentence as a Python warning."""
    warnings.warn(message, stacklevel=3)


def open_shapes(
    path: str | os.PathLike[str],
    category: str | None = None,
    split: str | None = None,
    report: Callable[[str], None] = warn,
    appearance: bool = False,
) -> Iterator[Shape]:
    """Yield the shapes of a mesh pack (.npz), a folder of packs or mesh files, or a manifest.

    A manifest (`kpred.shapes.manifest`) is a .csv, .json or .parquet file, or `manifest.csv` and the like in the
    folder; meshes are rotated and scaled as it says.

    Shapes are cleaned by ``clean_mesh``. ShapeNet models (``model_normalized``) have their front at -z and are turned
    by 180 degrees about y. A shape that cannot be read goes to ``report`` as one sentence and is left out.

    Args:
        path: the file or folder.
        category: keep this category only; see ``read_folder`` for folders that name none.
        split: keep this split only.
        report: called with the message of each shape that is left out; by default a Python warning.
        appearance: read materials, textures, names and the like of OBJ and glTF files too.

    Raises:
        PackError: a pack is damaged, or ``path`` is no pack, manifest or folder.
        ManifestError: a manifest is damaged or has no column of paths (`kpred.shapes.manifest`).
        MeshError: a folder has no meshes.
    """
    root = Path(path)
    if root.is_dir():
        manifest = folder_manifest(root)
        if manifest is not None:
            return _of_manifest(manifest, category, split, report, appearance)
        packs = sorted(root.glob("*.npz"))
        if packs:
            return (shape for pack in packs for shape in _of_pack(MeshPack.load(pack), category, split, report))
        items = read_folder(root, category)
        return _of_folder(items, report, appearance) if split in (None, "source") else iter(())
    if not root.exists():
        raise PackError(f"{root}: there is no such file; give a mesh pack (.npz) or a folder of mesh files.")
    if root.suffix.lower() in MANIFEST_EXTENSIONS:
        return _of_manifest(root, category, split, report, appearance)
    if root.suffix.lower() != ".npz":
        raise PackError(
            f"{root}: it is no mesh pack (.npz), manifest (.csv, .json, .parquet) or folder; give one of them."
        )
    return _of_pack(MeshPack.load(root), category, split, report)


def _of_pack(pack: MeshPack, category: str | None, split: str | None, report: Callable[[str], None]) -> Iterator[Shape]:
    if category is not None and category != pack.category:
        return
    for i in pack.indices(split):
        try:
            mesh = clean_mesh(pack[int(i)])
        except MeshError as error:
            report(str(error))
            continue
        yield Shape(str(pack.model_id[i]), pack.category, str(pack.split[i]), mesh)


def _of_manifest(
    file: Path, category: str | None, split: str | None, report: Callable[[str], None], appearance: bool
) -> Iterator[Shape]:
    """Yield shapes of a manifest; rows without a category get `category`, rows without a split `source`."""
    for row in read_manifest(file):
        kind, part = row.category or category, row.split or "source"
        if (category is not None and kind != category) or (split is not None and part != split):
            continue
        if row.problem or row.path is None or kind is None:
            report(row.problem or f"row {row.number} of {file.name} names no category")
            continue
        try:
            stand = partial(stand_mesh, up=row.up, front=row.front, size=row.size())
            mesh, kept = _read(row.path, stand, appearance)
        except MeshError as error:
            report(str(error))
            continue
        # Names are paths where the manifest has no column `id`.
        yield Shape(row.name, kind, part, mesh, row.details, kept)


def _of_folder(items: Iterator[FolderItem], report: Callable[[str], None], appearance: bool) -> Iterator[Shape]:
    for item in items:
        try:
            stand = partial(stand_mesh, up="y", front="-z" if item.faces_back else "z", size=None)
            mesh, kept = _read(item.path, stand, appearance)
        except MeshError as error:
            report(str(error))
            continue
        yield Shape(item.model_id, item.category, "source", replace(mesh, name=item.model_id), appearance=kept)


def _read(path: Path, stand: Stand, appearance: bool) -> tuple[Mesh, Appearance | None]:
    from kpred.shapes.mesh_io import read_mesh

    if not appearance:
        return stand(read_mesh(path)), None
    from kpred.shapes.appearance.read import read_mesh_appearance

    return read_mesh_appearance(path, stand)
