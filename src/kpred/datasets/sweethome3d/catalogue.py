"""Furniture libraries as a catalogue folder: a mesh with its materials per model, and `manifest.csv` about all of them.

    catalogue/manifest.csv
    catalogue/<category>/<name>/<name>.obj, its .mtl, textures and licence text
    catalogue/licences/<library>.txt

Models are in metres, y up, front +z, on the floor. The same libraries give the same bytes.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from kpred.atomic import atomic_path
from kpred.datasets.sweethome3d.categories import category_of_model, slug
from kpred.datasets.sweethome3d.library import Library, LibraryModel, open_library
from kpred.datasets.sweethome3d.licences import Licence, licence_of
from kpred.datasets.sweethome3d.obj_place import place_obj
from kpred.errors import MeshError, OutputError

COLUMNS = (
    *("id", "path", "category", "title", "author", "licence", "source"),
    *("width", "height", "depth", "up", "front", "tags", "changes"),
)

CHANGES = "turned and scaled to metres"
"""Changes, which CC BY requires to be stated."""

_MAP = re.compile(rb"^\s*(?:map_\w+|bump|disp|refl|decal)\s+(?:.*\s)?(\S+)\s*$", re.IGNORECASE | re.MULTILINE)


@dataclass(frozen=True)
class LeftOut:
    """A model that is not in the catalogue, and why."""

    key: str
    reason: str


@dataclass(frozen=True)
class CatalogueReport:
    """What was written.

    Attributes:
        folder: the catalogue; counts: models of each category; licences: models of each licence.
        left_out: models that were not written.
    """

    folder: Path
    counts: dict[str, int]
    licences: dict[str, int]
    left_out: tuple[LeftOut, ...]


def make_catalogue(libraries: Sequence[Path], folder: Path, categories: Sequence[str] | None = None) -> CatalogueReport:
    """Write the models of libraries (.sh3f), whose licence lets them be passed on, as a catalogue folder.

    Args:
        categories: write these alone; None writes all.

    Raises:
        MeshError: a library is missing or damaged; a damaged model is left out instead.
        OutputError: the folder cannot be written, or holds another thing than a catalogue.
    """
    _check_folder(folder)
    rows: list[dict[str, str]] = []
    left_out: list[LeftOut] = []
    for path in libraries:
        with open_library(path) as library:
            _write(folder / "licences" / f"{slug(library.name)}.txt", _library_licence(library))
            for model in library.models:
                category, licence = category_of_model(model), licence_of(library, model)
                if categories is not None and category not in categories:
                    continue
                if not licence.is_free:
                    left_out.append(LeftOut(model.key, f"licence {licence.name}"))
                    continue
                try:
                    rows.append(_write_model(folder, library, model, category, licence))
                except MeshError as error:
                    left_out.append(LeftOut(model.key, str(error)))
    rows.sort(key=lambda row: row["id"])
    _write(folder / "manifest.csv", _csv(rows))
    return CatalogueReport(folder, _counted(rows, "category"), _counted(rows, "licence"), tuple(left_out))


def _write_model(
    folder: Path, library: Library, model: LibraryModel, category: str, licence: Licence
) -> dict[str, str]:
    """Write one model and return its row of the manifest."""
    name = slug(model.key)
    obj, wanted = place_obj(library.read(model.obj), model.rotation, model.size, model.key)
    place, archive_folder = folder / category / name, PurePosixPath(model.obj).parent
    there = {PurePosixPath(member).name: member for member in library.beside(model)}
    if len(there) < len(library.beside(model)) or any(PurePosixPath(one).name != one for one in wanted):
        raise MeshError(f"{model.key}: its files lie in several folders; leave it out.")
    _write(place / f"{name}.obj", obj)
    for library_name in wanted:
        if library_name in there:
            materials = library.read(there[library_name])
            _write(place / library_name, materials)
            for texture in sorted({found.decode("utf-8", "replace") for found in _MAP.findall(materials)}):
                if texture in there:
                    _write(place / texture, library.read(there[texture]))
    for file in there:
        if "license" in file.lower() and str(archive_folder / file) == there[file]:
            _write(place / file, library.read(there[file]))
    width, height, depth = (f"{side:.4g}" for side in model.size)
    return {
        "id": f"{category}/{name}",
        "path": f"{category}/{name}/{name}.obj",
        "category": category,
        "title": model.title,
        "author": licence.author,
        "licence": licence.name,
        "source": licence.source,
        "width": width,
        "height": height,
        "depth": depth,
        "up": "y",
        "front": "z",
        "tags": model.tags,
        "changes": CHANGES,
    }


def _library_licence(library: Library) -> bytes:
    names = [name for name in library.archive.namelist() if "/" not in name and name.upper() == "LICENSE.TXT"]
    return library.read(names[0]) if names else f"{library.licence}\n".encode()


def _csv(rows: Sequence[dict[str, str]]) -> bytes:
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue().encode()


def _counted(rows: Sequence[dict[str, str]], column: str) -> dict[str, int]:
    values = [row[column] for row in rows]
    return {value: values.count(value) for value in sorted(set(values))}


def _check_folder(folder: Path) -> None:
    """Refuse a folder that holds something else: files of the catalogue replace those of the same name."""
    if folder.exists() and not folder.is_dir():
        raise OutputError(f"Cannot write {folder}: it is a file; give a folder.")
    if folder.is_dir() and any(folder.iterdir()) and not (folder / "manifest.csv").is_file():
        raise OutputError(f"Cannot write {folder}: it is not empty and no catalogue; give an empty folder.")


def _write(file: Path, data: bytes) -> None:
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"Cannot write {file}: {error.strerror or error}; give another folder.") from error
    with atomic_path(file) as temporary:
        temporary.write_bytes(data)
