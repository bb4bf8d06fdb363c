"""Mesh packs that are measured on: their files, their targets, and the sources that are searched."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

from kpred.database import Database
from kpred.errors import ConfigError, PackError
from kpred.evaluation.database_source import SOURCE_SPLIT, Progress, counter, database_source
from kpred.evaluation.methods.sources import Sources
from kpred.evaluation.tables.config import TableConfig
from kpred.evaluation.tables.targets import Target, read_targets
from kpred.nn import Model
from kpred.shapes import MeshPack

Store = Database | str | os.PathLike[str] | None


@dataclass(frozen=True, eq=False)
class SourcePack:
    """A mesh pack and where it comes from; its data set is named after the folder."""

    file: Path
    pack: MeshPack

    @property
    def dataset(self) -> str:
        """Name of the data set."""
        return self.file.resolve().parent.name

    @property
    def name(self) -> str:
        """Data set and category, for progress."""
        return f"{self.dataset}/{self.pack.category}"


def pack_files(packs: Sequence[str | os.PathLike[str]]) -> list[Path]:
    """List the files themselves, and the .npz files of folders in the order of their names.

    Raises:
        PackError: nothing was given, or a folder has no pack.
    """
    files: list[Path] = []
    for path in map(Path, packs):
        found = sorted(path.glob("*.npz")) if path.is_dir() else [path]
        if not found:
            raise PackError(f"{path}: the folder has no mesh packs; give .npz files, or a folder of them.")
        files += found
    if not files:
        raise PackError("There is no pack to evaluate on; give at least one .npz file.")
    return files


def checked_packs(files: Sequence[Path], models: Sequence[Model], split: str, needs_source: bool) -> list[SourcePack]:
    """Read and check all packs before anything is measured.

    Raises:
        PackError: one is missing, damaged, or has no shapes of a needed split.
        ModelError: a model does not know a pack's category.
    """
    packs = [SourcePack(file, MeshPack.load(file)) for file in files]
    for one in packs:
        for model in models:
            model[one.pack.category]
        check_split(one.file, one.pack, split)
        if needs_source and not len(one.pack.indices(SOURCE_SPLIT)):
            raise PackError(f"{one.file}: no shape is in the split '{SOURCE_SPLIT}' to search; give a database.")
    return packs


def check_split(file: Path, pack: MeshPack, split: str) -> None:
    """Refuse a pack without shapes of a split.

    Raises:
        PackError: the split is empty.
    """
    if not len(pack.indices(split)):
        found = ", ".join(sorted(set(pack.split.tolist()))) or "none"
        raise PackError(f"{file}: no shape is in the split '{split}'; its splits are {found}.")


@dataclass(frozen=True, eq=False)
class OpenPack:
    """A pack's targets and what they are measured against.

    Attributes:
        source: the pack; targets: of the configured split.
        stores: the database of each model; sources: the shapes that are searched.
    """

    source: SourcePack
    targets: list[Target]
    stores: dict[str, Database]
    sources: Sources

    @property
    def category(self) -> str:
        """Category of the pack."""
        return self.source.pack.category


@contextmanager
def open_pack(
    source: SourcePack,
    models: Mapping[str, Model],
    databases: Mapping[str, Store],
    config: TableConfig,
    cache: Path | None,
    progress: Progress | None,
    report: Callable[[str], None],
) -> Iterator[OpenPack]:
    """Open the targets and databases of one pack; the databases are closed at the end.

    Args:
        models: by name; databases: of each, None for one built from the pack's split `source`.
        cache: folder that keeps the databases that are built.
        report: called with one sentence for each shape left out, and when targets are in the database.

    Raises:
        PackError: no target has a surface.
        DatabaseError: a database is missing, was made by other weights, or has none of the category.
        ConfigError: the databases of the models hold different shapes.
    """
    pack, seed = source.pack, config.seed
    targets = read_targets(pack, str(source.file), config.split, config.limit, seed, report, config.only)
    with ExitStack() as stack:
        stores: dict[str, Database] = {}
        for name, model in models.items():
            beside = f" of {name}" if len(models) > 1 else ""
            building = counter(progress, f"{source.name}: database{beside}", len(pack.indices(SOURCE_SPLIT)))
            # Broken shapes are the same for every model.
            first_report = report if not stores else _silent
            opened = database_source(
                [source.file], model, databases.get(name), seed, building, first_report, cache=cache
            )
            stores[name] = stack.enter_context(opened)
        if stores:
            check_same_shapes(stores, pack.category)
            sources = Sources.of_databases(pack.category, models, stores)
        else:
            sources = stack.enter_context(Sources.of_pack(pack, str(source.file), seed, report))
        known = len(set(sources.model_ids) & {target.model_id for target in targets})
        if known:
            report(f"{source.file}: {known} of {len(targets)} targets are in the database; their errors say little.")
        yield OpenPack(source, targets, stores, sources)


def check_same_shapes(stores: Mapping[str, Database], category: str) -> None:
    """Refuse databases of models that cannot be compared.

    Raises:
        ConfigError: they hold different shapes of the category.
        DatabaseError: one holds none.
    """
    first = next(iter(stores))
    for name, store in stores.items():
        if store.model_ids(category) != stores[first].model_ids(category):
            raise ConfigError(
                f"The database of {name} holds other {category} shapes than that of {first}, so that the models cannot "
                "be compared; give databases of the same shapes."
            )


def _silent(sentence: str) -> None:
    pass
