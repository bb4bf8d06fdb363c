"""Models of the database, scanned: are they found again, and are they left as they are?

Every target is a model that the database holds. It is scanned virtually (`kpred.evaluation.scans.targets`) in
its own size, turned and moved, and fitted with its up axis and category given.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from kpred.database import Database
from kpred.errors import ConfigError, DatabaseError, MeshError, PackError
from kpred.evaluation.header import made_by, versions
from kpred.evaluation.metrics.summary import ALL, Scope, Summary
from kpred.evaluation.scans.catalogue_outcomes import CatalogueOutcome, measure_catalogue_scan
from kpred.evaluation.scans.catalogue_summaries import summarise_catalogue
from kpred.evaluation.scans.outcomes import Fitting
from kpred.evaluation.scans.targets import ScanTarget, make_scan_target
from kpred.evaluation.searched import SOURCE_SPLIT, Progress, counter, searched
from kpred.evaluation.tables.measuring import pack_files
from kpred.evaluation.tables.targets import chosen_rows, limited
from kpred.fitting.defaults import resolve_database, resolve_model
from kpred.nn import Model
from kpred.rendering.contact_sheet import Tile
from kpred.shapes import MeshPack
from kpred.shapes.mesh import Mesh

MAX_VIEWS = 20


@dataclass(frozen=True)
class CatalogueConfig:
    """How models are scanned and fitted.

    Attributes:
        views: depth views of each model; 0 scans its whole surface.
        limit: at most so many models of each category, drawn by seed; None for all.
        seed: of models, scans, databases that are built, fits and intervals.
        top_k: candidates of each fit.
        tiles: pictures of the worst results, where they are wanted.

    Raises:
        ConfigError: a number is impossible.
    """

    views: int = 1
    limit: int | None = 40
    seed: int = 0
    top_k: int = 10
    tiles: int = 0

    def __post_init__(self) -> None:
        if not 0 <= self.views <= MAX_VIEWS:
            raise ConfigError(f"The number of views must be from 0 to {MAX_VIEWS}, but is {self.views}.")
        if self.top_k < 1:
            raise ConfigError(f"top_k must be at least 1, but is {self.top_k}.")


@dataclass(frozen=True, eq=False)
class CatalogueReport:
    """Everything that was measured.

    Attributes:
        header: what it was made by; summaries: of every category, and of all.
        outcomes: (data set, outcome) of every model, failures too; tiles: pictures.
    """

    header: dict[str, Any]
    summaries: tuple[Summary, ...]
    outcomes: tuple[tuple[str, CatalogueOutcome], ...]
    tiles: tuple[Tile, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """Plain values: header, rows, targets."""
        return {
            "header": self.header,
            "rows": [summary.to_json() for summary in self.summaries],
            "targets": [{"dataset": dataset, **outcome.to_json()} for dataset, outcome in self.outcomes],
        }


@dataclass(frozen=True, eq=False)
class _Models:
    """Models of one category that a database holds."""

    dataset: str
    category: str
    model_ids: tuple[str, ...]
    mesh: Callable[[str], Mesh]


def evaluate_catalogue(
    packs: Sequence[str | os.PathLike[str]] = (),
    model: Model | str | os.PathLike[str] | None = None,
    database: Database | str | os.PathLike[str] | None = None,
    config: CatalogueConfig | None = None,
    *,
    progress: Progress | None = None,
    report: Callable[[str], None] = lambda sentence: None,
) -> CatalogueReport:
    """Scan models of a database and fit the scans against it.

    Args:
        packs: mesh packs, or folders of them, whose split `source` is scanned; without any, models of the database.
        model: trained networks, or their name or folder; None means bundled.
        database: where to search; None builds one of the packs' split `source`, or, without packs, means bundled.
        progress: called as the work goes on; report: with one sentence for each model left out.

    Raises:
        PackError: a pack is missing, damaged, or has no shapes of the split `source`.
        ModelError, DatabaseError: they are missing, do not fit each other, or the database lacks the packs' shapes.
    """
    plan = config or CatalogueConfig()
    networks = resolve_model(model)
    remarks: list[str] = []

    def tell(sentence: str) -> None:
        remarks.append(sentence)
        report(sentence)

    files = pack_files(packs) if packs else []
    loaded = {file: MeshPack.load(file) for file in files}
    outcomes: list[tuple[str, CatalogueOutcome]] = []
    shown: list[tuple[ScanTarget, CatalogueOutcome]] = []
    with ExitStack() as stack:
        store = stack.enter_context(_opened(loaded, networks, database, plan, progress, tell))
        how = Fitting(networks, store, plan.top_k, plan.seed)
        for models in _of_packs(loaded, store, plan) if files else _of_database(networks, store, plan):
            for done, target in enumerate(_targets(models, plan, tell), start=1):
                outcome = measure_catalogue_scan(target, models.category, how, plan.tiles > 0)
                outcomes.append((models.dataset, outcome))
                shown.append((target, outcome))
                if progress is not None:
                    progress(f"{models.dataset}/{models.category}: scans", done, len(models.model_ids))
        where = str(store.path) if database is not None or not files else _BUILT
    if not outcomes:
        raise PackError("No model could be scanned; give packs or a database of meshes with a surface.")
    return CatalogueReport(
        header=_header(networks, where, plan) | {"remarks": remarks},
        summaries=tuple(_summaries(outcomes, plan)),
        outcomes=tuple(outcomes),
        tiles=tuple(_tile(*pair) for pair in sorted(shown, key=_badness, reverse=True)[: plan.tiles]),
    )


_BUILT = f"built from the split '{SOURCE_SPLIT}' of all packs"


def _opened(
    loaded: dict[Path, MeshPack],
    networks: Model,
    database: Database | str | os.PathLike[str] | None,
    plan: CatalogueConfig,
    progress: Progress | None,
    report: Callable[[str], None],
) -> Any:
    """The database, as a context."""
    for file, pack in loaded.items():
        networks[pack.category]
        if not len(pack.indices(SOURCE_SPLIT)):
            raise PackError(f"{file}: no shape is in the split '{SOURCE_SPLIT}' to scan; give another pack.")
    given = resolve_database(None) if database is None and not loaded else database
    total = sum(len(pack.indices(SOURCE_SPLIT)) for pack in loaded.values())
    building = counter(progress, "database", total)
    return searched(list(loaded), networks, given, plan.seed, building, report)


def _of_packs(loaded: dict[Path, MeshPack], store: Database, plan: CatalogueConfig) -> Iterator[_Models]:
    for file, pack in loaded.items():
        rows = {str(pack.model_id[row]): row for row in chosen_rows(pack, SOURCE_SPLIT, plan.limit, plan.seed)}
        lacking = [name for name in rows if name not in store]
        if lacking:
            raise DatabaseError(
                f"Database {store.path}: it lacks {len(lacking)} of the {len(rows)} models of {file} to be scanned, as "
                f"{lacking[0]}; leave --database out, or add them."
            )
        yield _Models(file.resolve().parent.name, pack.category, tuple(rows), _reader(pack, rows))


def _reader(pack: MeshPack, rows: dict[str, int]) -> Callable[[str], Mesh]:
    return lambda name: pack[rows[name]]


def _of_database(networks: Model, store: Database, plan: CatalogueConfig) -> Iterator[_Models]:
    for category in (name for name in networks.categories if name in store.categories()):
        names = limited(store.model_ids(category), plan.limit, plan.seed)
        yield _Models(Path(store.path).stem, category, tuple(names), lambda name: store.entry(name).mesh)


def _targets(models: _Models, plan: CatalogueConfig, report: Callable[[str], None]) -> Iterator[ScanTarget]:
    for name in models.model_ids:
        try:
            yield make_scan_target(models.mesh(name), name, plan.seed, plan.views, own_size=True)
        except MeshError as error:
            report(f"left out: {error}")


def _summaries(outcomes: Sequence[tuple[str, CatalogueOutcome]], plan: CatalogueConfig) -> Iterator[Summary]:
    """Of every category of every data set, then of all together."""
    groups = list(dict.fromkeys((dataset, outcome.category) for dataset, outcome in outcomes))
    for dataset, category in groups:
        mine = [outcome for name, outcome in outcomes if (name, outcome.category) == (dataset, category)]
        yield from summarise_catalogue(mine, Scope(dataset, SOURCE_SPLIT, category, plan.seed))
    if len(groups) > 1:
        yield from summarise_catalogue([one for _, one in outcomes], Scope(ALL, SOURCE_SPLIT, ALL, plan.seed))


def _badness(pair: tuple[ScanTarget, CatalogueOutcome]) -> tuple[bool, bool, float]:
    outcome = pair[1]
    distance = math.inf if outcome.distance is None else outcome.distance
    return outcome.failure is not None, not outcome.first, distance


def _tile(target: ScanTarget, outcome: CatalogueOutcome) -> Tile:
    lines = [f"{outcome.category} {target.model_id}"]
    if outcome.failure is not None:
        return Tile((*lines, "failed", outcome.failure), "wrong", target.known)
    rank = "not among the candidates" if outcome.rank is None else f"right model is number {outcome.rank}"
    lines += [f"found: {outcome.model}; {rank}"]
    lines += [
        f"{outcome.step}; {100 * (outcome.distance or 0):.2f} % of the longest side, undeformed "
        f"{100 * (outcome.undeformed_distance or 0):.2f} %"
    ]
    return Tile(tuple(lines), "right" if outcome.first else "wrong", target.known, outcome.result)


def _header(model: Model, database: str, plan: CatalogueConfig) -> dict[str, Any]:
    return {
        **made_by(model),
        "database": database,
        "views": plan.views,
        "limit": plan.limit,
        "seed": plan.seed,
        "top_k": plan.top_k,
        "given": "up axis and category",
        "versions": versions(),
    }
