"""Models of the database, scanned: are they found again, and are they left as they are?

Every target is a model that the database holds. It is scanned virtually (`kpred.evaluation.scans.targets`) in
its own size, turned and moved, and fitted with its up axis and category given.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

from kpred.database import Database
from kpred.errors import DatabaseError, PackError
from kpred.evaluation.database_source import SOURCE_SPLIT, Progress, counter, database_source
from kpred.evaluation.header import provenance, versions
from kpred.evaluation.remarks import Remarks
from kpred.evaluation.scans.catalogue_outcomes import CatalogueOutcome, measure_catalogue_scan
from kpred.evaluation.scans.catalogue_summaries import summarise_catalogue
from kpred.evaluation.scans.outcome import FitSettings
from kpred.evaluation.scans.run import (
    ScanConfig,
    ScannedShapes,
    ScanReport,
    mesh_reader,
    run_scans,
    shown,
    summaries_of,
)
from kpred.evaluation.scans.targets import ScanTarget
from kpred.evaluation.tables.packs import pack_files
from kpred.evaluation.tables.targets import chosen_rows, limited
from kpred.fitting.defaults import resolve_database, resolve_model
from kpred.nn import Model
from kpred.rendering.contact_sheet import Tile
from kpred.shapes import MeshPack

_BUILT = f"built from the split '{SOURCE_SPLIT}' of all packs"


def evaluate_catalogue(
    packs: Sequence[str | os.PathLike[str]] = (),
    model: Model | str | os.PathLike[str] | None = None,
    database: Database | str | os.PathLike[str] | None = None,
    config: ScanConfig | None = None,
    *,
    progress: Progress | None = None,
    report: Callable[[str], None] = lambda sentence: None,
) -> ScanReport[CatalogueOutcome]:
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
    plan = config or ScanConfig()
    networks = resolve_model(model)
    remarks = Remarks(report)
    files = pack_files(packs) if packs else []
    loaded = {file: MeshPack.load(file) for file in files}
    with _opened(loaded, networks, database, plan, progress, remarks) as store:
        settings = FitSettings(networks, store, plan.top_k, plan.seed)
        groups = _of_packs(loaded, settings, plan) if files else _of_database(settings, plan)
        scanned = run_scans(groups, measure_catalogue_scan, plan, progress, remarks)
        where = str(store.path) if database is not None or not files else _BUILT
    worst = sorted(shown(scanned), key=_badness, reverse=True)[: plan.tiles]
    return ScanReport(
        header=_header(networks, where, plan) | {"remarks": remarks.sentences},
        summaries=tuple(summaries_of(scanned, summarise_catalogue, SOURCE_SPLIT, plan.seed)),
        outcomes=tuple((one.dataset, one.outcome) for one in scanned),
        tiles=tuple(_tile(*pair) for pair in worst),
    )


def _opened(
    loaded: dict[Path, MeshPack],
    networks: Model,
    database: Database | str | os.PathLike[str] | None,
    plan: ScanConfig,
    progress: Progress | None,
    report: Callable[[str], None],
) -> AbstractContextManager[Database]:
    """Open the database."""
    for file, pack in loaded.items():
        networks[pack.category]
        if not len(pack.indices(SOURCE_SPLIT)):
            raise PackError(f"{file}: no shape is in the split '{SOURCE_SPLIT}' to scan; give another pack.")
    given = resolve_database(None) if database is None and not loaded else database
    total = sum(len(pack.indices(SOURCE_SPLIT)) for pack in loaded.values())
    building = counter(progress, "database", total)
    return database_source(list(loaded), networks, given, plan.seed, building, report)


def _of_packs(loaded: dict[Path, MeshPack], settings: FitSettings, plan: ScanConfig) -> Iterator[ScannedShapes]:
    store = settings.database
    for file, pack in loaded.items():
        rows = {str(pack.model_id[row]): row for row in chosen_rows(pack, SOURCE_SPLIT, plan.limit, plan.seed)}
        lacking = [name for name in rows if name not in store]
        if lacking:
            raise DatabaseError(
                f"Database {store.path}: it lacks {len(lacking)} of the {len(rows)} models of {file} to be scanned, as "
                f"{lacking[0]}; leave --database out, or add them."
            )
        dataset, read = file.resolve().parent.name, mesh_reader(pack, rows)
        yield ScannedShapes(dataset, pack.category, tuple(rows), read, settings, own_size=True)


def _of_database(settings: FitSettings, plan: ScanConfig) -> Iterator[ScannedShapes]:
    store = settings.database
    for category in (name for name in settings.model.categories if name in store.categories()):
        names = limited(store.model_ids(category), plan.limit, plan.seed)
        dataset = Path(store.path).stem
        yield ScannedShapes(
            dataset, category, tuple(names), lambda name: store.entry(name).mesh, settings, own_size=True
        )


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


def _header(model: Model, database: str, plan: ScanConfig) -> dict[str, Any]:
    return {
        **provenance(model),
        "database": database,
        "views": plan.views,
        "limit": plan.limit,
        "seed": plan.seed,
        "top_k": plan.top_k,
        "given": "up axis and category",
        "versions": versions(),
    }
