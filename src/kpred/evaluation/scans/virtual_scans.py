"""Virtual scans of a pack's shapes, fitted with nothing given but gravity, and again with everything given.

For every target (`kpred.evaluation.scans.targets`): `unknown` is a fit of the scan as it stands, `known` a fit
of the same points in the whole object's unit box and canonical axes, with the category given. Both are partial scans
with the same noise and outliers; the known one is not cleaned. The category must be found among all packs of a
folder: the database holds the split `source` of all of them.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from kpred.database import Database
from kpred.errors import ConfigError, DatabaseError, MeshError, PackError
from kpred.evaluation.header import made_by, versions
from kpred.evaluation.metrics.reliability import Reliability
from kpred.evaluation.metrics.summary import ALL, Scope, Summary
from kpred.evaluation.scans import targets as scan_targets
from kpred.evaluation.scans.outcomes import NEAR, YAW_RIGHT, Fitting, ScanOutcome, measure_other, measure_scan
from kpred.evaluation.scans.summaries import confusion, reliability_of, summarise
from kpred.evaluation.scans.targets import ScanTarget, make_scan_target
from kpred.evaluation.scans.tiles import worst_and_typical
from kpred.evaluation.searched import SOURCE_SPLIT, Progress, counter, searched
from kpred.evaluation.tables.measuring import pack_files
from kpred.evaluation.tables.targets import chosen_rows
from kpred.nn import Model, load_model
from kpred.rendering.contact_sheet import Tile
from kpred.shapes import MeshPack
from kpred.training.recognition_data import OTHER


@dataclass(frozen=True, eq=False)
class ScansReport:
    """Everything that was measured.

    Attributes:
        header: what it was made by.
        summaries: of every pack, of every data set with several packs, and of all together if there are several.
        confusion: true category -> category found -> how many.
        reliability: of the confidence, other things counting as wrong; None where no result had one.
        outcomes: (data set, outcome) of every target, failures too.
        tiles: pictures of the worst and of some typical targets, where they were asked for.
    """

    header: dict[str, Any]
    summaries: tuple[Summary, ...]
    confusion: dict[str, dict[str, int]]
    reliability: Reliability | None
    outcomes: tuple[tuple[str, ScanOutcome], ...]
    tiles: tuple[Tile, ...] = ()

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
        """Plain values: header, rows, confusion, reliability, targets, failures."""
        return {
            "header": self.header,
            "rows": [summary.to_json() for summary in self.summaries],
            "confusion": self.confusion,
            "reliability": None if self.reliability is None else asdict(self.reliability),
            "targets": [{"dataset": dataset, **outcome.to_json()} for dataset, outcome in self.outcomes],
            "failures": list(self.failures),
        }


def _warn(message: str) -> None:
    warnings.warn(message, stacklevel=3)


def evaluate_scans(
    packs: Sequence[str | os.PathLike[str]],
    model: Model | str | os.PathLike[str] | None = None,
    database: Database | str | os.PathLike[str] | None = None,
    *,
    split: str = "val",
    limit: int | None = 40,
    seed: int = 0,
    top_k: int = 10,
    worst: int = 0,
    progress: Progress | None = None,
    report: Callable[[str], None] = _warn,
) -> ScansReport:
    """Measure fits of virtual scans of all shapes of a split, or of `limit` of each pack, drawn by seed.

    Args:
        packs: files of mesh packs, or folders of them; the name of a file's folder is the name of its data set. A pack
            of the category `other` holds things that are of none of the categories.
        model: trained networks, or their name or folder; None means bundled.
        database: where to search; None builds one for every folder from the split `source` of its packs.
        seed: of targets, scans, databases that are built, fits and intervals.
        top_k: how many retrieved models are deformed and compared.
        worst: how many of the worst targets get a tile of the contact sheet; half as many typical ones, and as many
            other things, come after.
        progress: called as the work goes on.
        report: called with one sentence for each shape left out.

    Raises:
        PackError: a pack is missing, damaged, or has no shapes of a needed split.
        ModelError, DatabaseError: they are missing, do not fit each other, or do not know a pack's category.
        ConfigError: an argument has an impossible value.
    """
    if top_k < 1:
        raise ConfigError(f"top_k must be at least 1, but is {top_k}.")
    remarks: list[str] = []

    def tell(sentence: str) -> None:
        remarks.append(sentence)
        report(sentence)

    files = pack_files(packs)
    networks = model if isinstance(model, Model) else load_model(model)
    loaded = {file: MeshPack.load(file) for file in files}
    for file, pack in loaded.items():
        _check(file, pack, networks, split)
    sources = {file: _sources(file, loaded, needed=database is None) for file in loaded}
    outcomes: list[tuple[str, ScanOutcome]] = []
    shown: list[tuple[ScanTarget, ScanOutcome]] = []
    summaries: list[Summary] = []
    with ExitStack() as stack:
        stores: dict[tuple[Path, ...], Database] = {}
        for file, pack in loaded.items():
            dataset = file.resolve().parent.name
            if sources[file] not in stores:
                number = sum(len(loaded[source].indices(SOURCE_SPLIT)) for source in sources[file])
                building = counter(progress, f"{dataset}: database", number)
                opened = searched(sources[file], networks, database, seed, building, tell)
                stores[sources[file]] = stack.enter_context(opened)
            _check_store(stores[sources[file]], file, pack, split, tell)
            how = Fitting(networks, stores[sources[file]], top_k, seed)
            name = f"{dataset}/{pack.category}: scans of {split}"
            mine: list[ScanOutcome] = []
            rows = chosen_rows(pack, split, limit, seed)
            for done, target in enumerate(_targets(pack, rows, seed, tell), start=1):
                measure = measure_other if pack.category == OTHER else measure_scan
                mine.append(measure(target, pack.category, how, worst > 0))
                if worst > 0:
                    shown.append((target, mine[-1]))
                if progress is not None:
                    progress(name, done, len(rows))
            if not mine:
                raise PackError(f"{file}: no shape of the split '{split}' has a surface; choose another split.")
            outcomes += [(dataset, outcome) for outcome in mine]
            summaries += summarise(mine, Scope(dataset, split, pack.category, seed))
    everyone = [outcome for _, outcome in outcomes]
    return ScansReport(
        header=_header(networks, database, split=split, limit=limit, seed=seed, top_k=top_k) | {"remarks": remarks},
        summaries=(*summaries, *_pooled(outcomes, len(loaded), split, seed)),
        confusion=confusion(everyone),
        reliability=reliability_of(everyone),
        outcomes=tuple(outcomes),
        tiles=tuple(worst_and_typical(shown, worst)),
    )


def _targets(pack: MeshPack, rows: Sequence[int], seed: int, report: Callable[[str], None]) -> Iterator[ScanTarget]:
    for row in rows:
        try:
            target = make_scan_target(pack[row], str(pack.model_id[row]), seed)
        except MeshError as error:
            report(f"left out: {error}")
            continue
        yield target


def _check(file: Path, pack: MeshPack, model: Model, split: str) -> None:
    if pack.category != OTHER:
        model[pack.category]
    if not len(pack.indices(split)):
        found = ", ".join(sorted(set(pack.split.tolist()))) or "none"
        raise PackError(f"{file}: no shape is in the split '{split}'; its splits are {found}.")


def _check_store(store: Database, file: Path, pack: MeshPack, split: str, report: Callable[[str], None]) -> None:
    if pack.category != OTHER and pack.category not in store.categories():
        raise DatabaseError(f"Database {store.path}: it holds no {pack.category}, which {file} asks for; add some.")
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


def _pooled(outcomes: Sequence[tuple[str, ScanOutcome]], packs: int, split: str, seed: int) -> Iterator[Summary]:
    """Of every data set with several categories, then of all packs."""
    datasets = list(dict.fromkeys(dataset for dataset, _ in outcomes))
    for dataset in datasets:
        mine = [outcome for name, outcome in outcomes if name == dataset]
        if len({outcome.category for outcome in mine}) > 1 and len(datasets) > 1:
            yield from summarise(mine, Scope(dataset, split, ALL, seed))
    if packs > 1:
        yield from summarise([outcome for _, outcome in outcomes], Scope(ALL, split, ALL, seed))


def _header(
    model: Model,
    database: Database | str | os.PathLike[str] | None,
    *,
    split: str,
    limit: int | None,
    seed: int,
    top_k: int,
) -> dict[str, Any]:
    path = database.path if isinstance(database, Database) else database
    return {
        **made_by(model),
        "database": f"built from the split '{SOURCE_SPLIT}' of all packs of a folder" if path is None else str(path),
        "split": split,
        "limit": limit,
        "seed": seed,
        "top_k": top_k,
        "scans": {
            "elevation_degrees": list(scan_targets.ELEVATION),
            "distance_longest_sides": list(scan_targets.DISTANCE),
            "most_noise_half_longest_side": scan_targets.NOISE,
            "most_outliers": scan_targets.OUTLIERS,
            "outlier_box": scan_targets.OUTLIER_BOX,
            "longest_side": list(scan_targets.LONGEST_SIDE),
            "most_offset": scan_targets.OFFSET,
        },
        "right": f"category right, yaw within {YAW_RIGHT:g} degrees up to symmetry, whole surface nearer than {NEAR:g} "
        "unit box on average to the result",
        "versions": versions(),
    }
