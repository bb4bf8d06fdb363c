"""Virtual scans of a pack's shapes, fitted with nothing given but gravity, and again with everything given.

For every target (`kpred.evaluation.scans.targets`): `unknown` is a fit of the scan as it stands, `known` a fit
of the same points in the whole object's unit box and canonical axes, with the category given. Both are partial scans
with the same noise and outliers; the known one is not cleaned. The category must be found among all packs of a
folder: the database holds the split `source` of all of them.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from kpred.database import Database
from kpred.errors import DatabaseError, PackError
from kpred.evaluation.database_source import SOURCE_SPLIT, Progress, counter, database_source
from kpred.evaluation.header import provenance, versions
from kpred.evaluation.metrics.reliability import Reliability
from kpred.evaluation.remarks import Remarks
from kpred.evaluation.scans import targets as scan_targets
from kpred.evaluation.scans.outcome import YAW_RIGHT, FitSettings
from kpred.evaluation.scans.run import (
    ScanConfig,
    ScannedShapes,
    ScanReport,
    mesh_reader,
    run_scans,
    shown,
    summaries_of,
)
from kpred.evaluation.scans.scan_outcomes import NEAR, ScanOutcome, measure_other, measure_scan
from kpred.evaluation.scans.scan_summaries import confusion, reliability_of, summarise
from kpred.evaluation.scans.targets import ScanTarget
from kpred.evaluation.scans.tiles import worst_and_typical
from kpred.evaluation.tables.packs import check_split, pack_files
from kpred.evaluation.tables.targets import chosen_rows
from kpred.nn import Model, load_model
from kpred.shapes import MeshPack
from kpred.shapes.source import warn
from kpred.training.recognition_data import OTHER


@dataclass(frozen=True, eq=False, kw_only=True)
class ScansReport(ScanReport[ScanOutcome]):
    """All that was measured.

    Attributes:
        confusion: true category -> category found -> how many.
        reliability: of the confidence, other things counting as wrong; None where no result had one.
        tiles: pictures of the worst and of some typical targets, if they are wanted.
    """

    confusion: dict[str, dict[str, int]]
    reliability: Reliability | None

    @property
    def failures(self) -> tuple[str, ...]:
        """One sentence for each fit that raised."""
        return tuple(
            f"{dataset}/{outcome.category} {outcome.model_id}, {name}: {why}"
            for dataset, outcome in self.outcomes
            for name, why in (("nothing given", outcome.failure), ("all given", outcome.known_failure))
            if why is not None
        )

    def to_json(self) -> dict[str, Any]:
        """Return plain values: header, rows, confusion, reliability, targets, failures."""
        return super().to_json() | {
            "confusion": self.confusion,
            "reliability": None if self.reliability is None else asdict(self.reliability),
            "failures": list(self.failures),
        }


def evaluate_scans(
    packs: Sequence[str | os.PathLike[str]],
    model: Model | str | os.PathLike[str] | None = None,
    database: Database | str | os.PathLike[str] | None = None,
    config: ScanConfig | None = None,
    *,
    split: str = "val",
    progress: Progress | None = None,
    report: Callable[[str], None] = warn,
) -> ScansReport:
    """Measure fits of virtual scans of all shapes of a split, or of some of each pack.

    Args:
        packs: files of mesh packs, or folders of them; the name of a file's folder is the name of its data set. A pack
            of the category `other` holds things that are of none of the categories.
        model: trained networks, or their name or folder; None means bundled.
        database: where to search; None builds one for every folder from the split `source` of its packs.
        config: its `tiles` are the worst targets; half as many typical ones, and as many other things, come after.
        progress: called as the work goes on; report: with one sentence for each shape left out.

    Raises:
        PackError: a pack is missing, damaged, or has no shapes of a needed split.
        ModelError, DatabaseError: they are missing, do not fit each other, or do not know a pack's category.
    """
    plan = config or ScanConfig()
    remarks = Remarks(report)
    networks = model if isinstance(model, Model) else load_model(model)
    loaded = {file: MeshPack.load(file) for file in pack_files(packs)}
    for file, pack in loaded.items():
        if pack.category != OTHER:
            networks[pack.category]
        check_split(file, pack, split)
    sources = {file: _sources(file, loaded, needed=database is None) for file in loaded}
    with ExitStack() as stack:
        stores = _Stores(networks, database, plan, loaded, stack, progress, remarks)
        groups = (
            _group(file, pack, stores.of(file, sources[file]), split, plan, remarks) for file, pack in loaded.items()
        )
        scanned = run_scans(groups, _measure, plan, progress, remarks)
    everyone = [one.outcome for one in scanned]
    return ScansReport(
        header=_header(networks, database, split, plan) | {"remarks": remarks.sentences},
        summaries=tuple(summaries_of(scanned, summarise, split, plan.seed)),
        confusion=confusion(everyone),
        reliability=reliability_of(everyone),
        outcomes=tuple((one.dataset, one.outcome) for one in scanned),
        tiles=tuple(worst_and_typical(shown(scanned), plan.tiles)),
    )


@dataclass(frozen=True, eq=False)
class _Stores:
    """Databases of source packs, each opened or built at first use and closed with `stack`."""

    networks: Model
    database: Database | str | os.PathLike[str] | None
    plan: ScanConfig
    packs: dict[Path, MeshPack]
    stack: ExitStack
    progress: Progress | None
    report: Callable[[str], None]
    opened: dict[tuple[Path, ...], FitSettings] = field(default_factory=dict)

    def of(self, file: Path, sources: tuple[Path, ...]) -> FitSettings:
        """Return the settings of fits against the source shapes of some packs."""
        if sources not in self.opened:
            number = sum(len(self.packs[source].indices(SOURCE_SPLIT)) for source in sources)
            building = counter(self.progress, f"{file.resolve().parent.name}: database", number)
            opening = database_source(sources, self.networks, self.database, self.plan.seed, building, self.report)
            store = self.stack.enter_context(opening)
            self.opened[sources] = FitSettings(self.networks, store, self.plan.top_k, self.plan.seed)
        return self.opened[sources]


def _group(
    file: Path, pack: MeshPack, settings: FitSettings, split: str, plan: ScanConfig, report: Callable[[str], None]
) -> ScannedShapes:
    _check_store(settings.database, file, pack, split, report)
    rows = {str(pack.model_id[row]): row for row in chosen_rows(pack, split, plan.limit, plan.seed)}
    read = mesh_reader(pack, rows)
    return ScannedShapes(file.resolve().parent.name, pack.category, tuple(rows), read, settings)


def _measure(target: ScanTarget, category: str, settings: FitSettings, keep_mesh: bool) -> ScanOutcome:
    measure = measure_other if category == OTHER else measure_scan
    return measure(target, category, settings, keep_mesh)


def _check_store(store: Database, file: Path, pack: MeshPack, split: str, report: Callable[[str], None]) -> None:
    if pack.category != OTHER and pack.category not in store.categories():
        raise DatabaseError(f"Database {store.path}: it holds no {pack.category}, which {file} needs; add some.")
    known = set(store.model_ids()) & set(pack.model_id[pack.indices(split)].tolist())
    if known:
        report(f"{file}: {len(known)} shapes of its split '{split}' are in the database; their errors say little.")


def _sources(file: Path, packs: dict[Path, MeshPack], needed: bool) -> tuple[Path, ...]:
    """Packs whose source shapes are searched: those of the file's folder, or, where it has none, all that are given."""
    if not needed:
        return ()
    known = [source for source, pack in packs.items() if pack.category != OTHER and len(pack.indices(SOURCE_SPLIT))]
    beside = [source for source in known if source.resolve().parent == file.resolve().parent]
    if packs[file].category != OTHER and file not in beside:
        raise PackError(f"{file}: no shape is in the split '{SOURCE_SPLIT}' to search; give a database.")
    if not known:
        raise PackError(f"{file}: no pack with source shapes to search is given beside it; give one, or a database.")
    return tuple(beside or known)


def _header(
    model: Model, database: Database | str | os.PathLike[str] | None, split: str, plan: ScanConfig
) -> dict[str, Any]:
    path = database.path if isinstance(database, Database) else database
    return {
        **provenance(model),
        "database": f"built from the split '{SOURCE_SPLIT}' of all packs of a folder" if path is None else str(path),
        "split": split,
        "views": plan.views,
        "limit": plan.limit,
        "seed": plan.seed,
        "top_k": plan.top_k,
        "scans": {
            "elevation_degrees": list(scan_targets.ELEVATION),
            "distance_longest_sides": list(scan_targets.DISTANCE),
            "max_noise_half_longest_side": scan_targets.NOISE,
            "max_outliers": scan_targets.OUTLIERS,
            "outlier_box": scan_targets.OUTLIER_BOX,
            "longest_side": list(scan_targets.LONGEST_SIDE),
            "max_offset": scan_targets.OFFSET,
        },
        "right": f"category right, yaw within {YAW_RIGHT:g} degrees up to symmetry, whole surface nearer than {NEAR:g} "
        "unit box on average to the result",
        "versions": versions(),
    }
