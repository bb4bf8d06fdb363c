"""A folder of mesh files as a collection of shapes."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from kpred.errors import MeshError
from kpred.shapes.mesh_io import MESH_EXTENSIONS

# ShapeNet synsets and other usual folder names -> category. Storage furniture is one category.
CATEGORY_OF = {
    "03001627": "chair",
    "04379243": "table",
    "02933112": "cabinet",
    "02871439": "cabinet",
    "03337140": "cabinet",
    "chairs": "chair",
    "tables": "table",
    "desk": "table",
    "desks": "table",
    "cabinets": "cabinet",
    "bookshelf": "cabinet",
    "bookcase": "cabinet",
    "bookcases": "cabinet",
    "storagefurniture": "cabinet",
}

# Files named so are called after their folder.
_ANONYMOUS = ("model", "model_normalized", "mesh", "models")


@dataclass(frozen=True)
class FolderItem:
    """One mesh file of a folder.

    Attributes:
        model_id: unique within the folder.
        category: lower-case name.
        path: the file; nothing of it has been read yet.
        faces_back: the model's front is -z, as in ShapeNetCore.v2, and not +z.
    """

    model_id: str
    category: str
    path: Path
    faces_back: bool = False


def read_folder(path: str | os.PathLike[str], category: str | None = None) -> Iterator[FolderItem]:
    """List the meshes of a folder, sorted by path, without reading them.

    Layouts: ``folder/*.obj``; ``folder/<category>/*.glb``; ShapeNet's
    ``folder/<synset>/<model id>/models/model_normalized.obj``, also below one synset's folder. Category names and
    synsets of chairs, tables and storage furniture are translated; other folder names are taken as they are.

    Args:
        path: the folder.
        category: where folders name this category, only its shapes are listed; otherwise every shape gets it.

    Raises:
        MeshError: no such folder, or no mesh file in it.
    """
    root = Path(path)
    if not root.is_dir():
        raise MeshError(f"{root}: there is no such folder; give a folder of mesh files.")
    files = sorted(file for file in root.rglob("*") if file.suffix.lower() in MESH_EXTENSIONS and _is_shown(file, root))
    if not files:
        raise MeshError(f"{root}: there are no meshes in it; put {', '.join(MESH_EXTENSIONS)} files there.")
    named = [_described(file, root) for file in files]
    wanted = None if category is None else _category(category)
    if wanted is not None and any(item.category == wanted for item in named):
        named = [item for item in named if item.category == wanted]
    elif wanted is not None:
        named = [FolderItem(item.model_id, wanted, item.path, item.faces_back) for item in named]
    return iter(_with_unique_ids(named, root))


def _is_shown(file: Path, root: Path) -> bool:
    relative = file.relative_to(root)
    return file.is_file() and not any(part.startswith(".") for part in relative.parts)


def _category(name: str) -> str:
    lower = name.lower()
    return CATEGORY_OF.get(lower, lower)


def _described(file: Path, root: Path) -> FolderItem:
    folders = list(file.relative_to(root).parts[:-1])
    model_id = file.stem
    if folders and model_id.lower() in _ANONYMOUS:
        if folders[-1].lower() == "models" and len(folders) > 1:
            folders.pop()
        model_id = folders.pop()
    category = _category(folders[0] if folders else root.resolve().name)
    return FolderItem(model_id, category, file, file.stem == "model_normalized")


def _with_unique_ids(items: list[FolderItem], root: Path) -> list[FolderItem]:
    count = Counter(item.model_id for item in items)
    result, taken = [], {model_id for model_id, n in count.items() if n == 1}
    for item in items:
        model_id = item.model_id
        if count[model_id] > 1:
            # The path below the folder makes them unique, with "_" for every separator; a number if even that clashes.
            model_id = "_".join(item.path.relative_to(root).parts).replace(".", "_")
            stem, number = model_id, 2
            while model_id in taken:
                model_id, number = f"{stem}_{number}", number + 1
            taken.add(model_id)
        result.append(FolderItem(model_id, item.category, item.path, item.faces_back))
    return result
