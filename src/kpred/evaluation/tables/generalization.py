"""How far networks carry to other shapes: categories seen and not seen in training, other sources, random templates.

Every target is fitted in its known frame with models of its own category, all deformed as `kpred.fit` deforms them:
    structure                    the best of the first k retrieved by tokens
    structure_random_templates   the best of k templates drawn at random: what retrieval is worth
    undeformed_nearest, sampling_floor   as in `kpred.evaluation.tables.scorer`
Targets are shapes of mesh packs or models of databases; what is searched is a database, without the target itself.
"""

from __future__ import annotations

import os
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch

from kpred.database import Database
from kpred.errors import ConfigError, MeshError, PackError
from kpred.evaluation.database_source import Progress, content_hash, counter, database_source
from kpred.evaluation.header import provenance, versions
from kpred.evaluation.methods.kp_red import STRUCTURE
from kpred.evaluation.methods.method import NO_MODEL
from kpred.evaluation.metrics.metric import CD, FRAME, UNIT, Metric
from kpred.evaluation.remarks import Remarks
from kpred.evaluation.tables.packs import check_split, pack_files
from kpred.evaluation.tables.scorer import FLOOR, FULL, UNDEFORMED
from kpred.evaluation.tables.table import Series, Subject, Table
from kpred.evaluation.tables.targets import Target, limited, make_target, read_targets
from kpred.fitting.candidates import Candidates
from kpred.fitting.options import FitOptions
from kpred.fitting.selection import rank_candidates
from kpred.fitting.stages import CleanScan, Context, Tried, try_poses
from kpred.fitting.whole_or_partial import deform_readings
from kpred.nn import Model, load_model
from kpred.ops import chamfer_distance
from kpred.pose.recognition import PoseHypothesis
from kpred.refinement.config import RefineConfig
from kpred.refinement.structure_config import StructureConfig
from kpred.shapes import MeshPack

RANDOM = "structure_random_templates"
KIND = "generalization"
MIN_TEMPLATES = 3
"""Categories with fewer templates are left out: there is nothing to choose from."""


@dataclass(frozen=True)
class GeneralizationConfig:
    """What is measured.

    Attributes:
        split: of mesh packs, whose shapes are the targets; limit: of each category, drawn by seed; None for all.
        top_k: numbers of models that are deformed and compared.
        templates: of each category, drawn by seed; None for all of the database.
        held_out: categories that the networks were not trained on.

    Raises:
        ConfigError: a number is below 1.
    """

    split: str = "val"
    limit: int | None = None
    seed: int = 0
    top_k: tuple[int, ...] = (1, 10)
    templates: int | None = 50
    held_out: tuple[str, ...] = ()
    structure: StructureConfig = field(default_factory=StructureConfig)

    def __post_init__(self) -> None:
        if not self.top_k or min(self.top_k) < 1 or (self.templates is not None and self.templates < 1):
            raise ConfigError("top_k and templates must be at least 1.")


@dataclass(frozen=True, eq=False)
class _Group:
    """Targets of one category, and the database whose templates they are fitted with."""

    dataset: str
    category: str
    targets: list[Target]
    database: Database


def generalization_table(
    places: Sequence[str | os.PathLike[str]],
    model: Model | str | os.PathLike[str] | None = None,
    database: str | os.PathLike[str] | None = None,
    config: GeneralizationConfig | None = None,
    *,
    cache: Path | None = None,
    progress: Progress | None = None,
) -> Table:
    """Measure how well targets are explained by retrieved and by random templates of their category.

    Args:
        places: mesh packs, or folders of them, and databases (.kpred), whose shapes are the targets.
        model: trained networks, or their name or folder; None means bundled.
        database: whose models are the templates; None searches a pack's split `source`, and of a database itself.
        cache: folder that keeps the databases that are built.

    Raises:
        PackError: a pack is missing, damaged, or has no shapes of the split; or nothing is left to measure.
        ModelError, DatabaseError: they are missing, or do not fit each other.
    """
    plan = config or GeneralizationConfig()
    networks = model if isinstance(model, Model) else load_model(model)
    remarks = Remarks(lambda sentence: None)
    table = Table(_header(networks, places, database, plan) | {"remarks": remarks.sentences})
    name = Path(networks.name).name
    with torch.inference_mode():
        for group in _groups(places, networks, database, plan, cache, progress, remarks):
            templates = limited(group.database.model_ids(group.category), plan.templates, plan.seed)
            if len(templates) <= MIN_TEMPLATES:
                remarks(f"{group.dataset}/{group.category}: {len(templates)} templates are too few; left out.")
                continue
            table.header["database_models"][f"{group.dataset}/{group.category}"] = len(templates)
            context = Context(networks, group.database, (group.category,))
            for done, target in enumerate(group.targets, start=1):
                subject = Subject(group.dataset, group.category, target.model_id)
                for series, value in _measured(target, templates, context, name, plan):
                    table.add(series, subject, value)
                if progress is not None:
                    progress(f"{group.dataset}/{group.category}", done, len(group.targets))
    if not table.values:
        raise PackError("Nothing was measured: no category has enough templates; give a larger database.")
    return table


def _measured(
    target: Target, templates: Sequence[str], context: Context, model: str, config: GeneralizationConfig
) -> Iterator[tuple[Series, float]]:
    category = context.categories[0]
    tried = _retrieve_all(target, context, len(context.database.model_ids(category)))
    found, wanted = tried.best.candidates, set(templates) - {target.model_id}
    rows = [row for row, name in enumerate(found.model_ids) if name in wanted]
    goal = target.points[None]
    apart = chamfer_distance(goal.expand(len(rows), -1, -1), found.points[rows])
    floor = float(chamfer_distance(goal, target.again[None]))
    yield Series(NO_MODEL, FLOOR, FULL, 0.0, Metric(CD)), floor
    yield Series(NO_MODEL, UNDEFORMED, FULL, 0.0, Metric(CD)), float(apart.min())
    drawn = np.random.default_rng([config.seed, zlib.crc32(target.model_id.encode())]).permutation(rows)
    for k in sorted(set(config.top_k)):
        nearest = rows[: FitOptions(top_k=k).retrieved]
        for method, chosen in ((STRUCTURE, nearest), (RANDOM, drawn[:k].tolist())):
            best = _best(found.take(torch.tensor(chosen)), tried, k, config)
            error = float(chamfer_distance(goal, best[None]))
            yield Series(model, method, FULL, 0.0, Metric(CD, top_k=k)), error


def _retrieve_all(target: Target, context: Context, count: int) -> Tried:
    """Retrieve a whole category for a target whose whole surface is seen in its known frame, the nearest first."""
    options = FitOptions(top_k=count, frame="known", partial=False, clean=False, deform="free")
    cloud = CleanScan(target.points.double().numpy(), len(target.points), "y", None, ())
    return try_poses(cloud, [PoseHypothesis(np.eye(3), context.categories[0])], context, options)


def _best(candidates: Candidates, tried: Tried, top_k: int, config: GeneralizationConfig) -> torch.Tensor:
    """Deform candidates as a fit does; return the points (N, 3) of the one that it would deliver."""
    refinement, structure = RefineConfig(), config.structure
    deformed = deform_readings(
        candidates, None, tried.visibility, "auto", refinement=refinement, structure=structure, top_k=top_k
    )
    return torch.from_numpy(deformed.explanations[rank_candidates(deformed)[0]].points).float()


def _groups(
    places: Sequence[str | os.PathLike[str]],
    model: Model,
    database: str | os.PathLike[str] | None,
    config: GeneralizationConfig,
    cache: Path | None,
    progress: Progress | None,
    report: Callable[[str], None],
) -> Iterator[_Group]:
    """Yield the targets of each place, category after category; databases are open until the next group."""
    for place in _files(places):
        if place.suffix == ".kpred":
            with Database.open(place, read_only=True) as own, _opened(own, model, database) as store:
                for category in sorted(set(own.categories()) & set(store.categories())):
                    targets = list(_models(own, category, config, report))
                    yield _Group(place.stem, category, targets, store)
            continue
        pack = MeshPack.load(place)
        model[pack.category]
        check_split(place, pack, config.split)
        targets = read_targets(pack, str(place), config.split, config.limit, config.seed, report)
        building = counter(progress, f"{place.stem}: database", len(pack))
        with database_source([place], model, database, config.seed, building, report, cache=cache) as store:
            if pack.category in store.categories():
                yield _Group(place.resolve().parent.name, pack.category, targets, store)
            else:
                report(f"{place}: the database has no models of {pack.category}; left out.")


def _files(places: Sequence[str | os.PathLike[str]]) -> list[Path]:
    databases = [Path(place) for place in places if Path(place).suffix == ".kpred"]
    packs = [place for place in places if Path(place).suffix != ".kpred"]
    return [*(pack_files(packs) if packs else []), *databases]


def _opened(own: Database, model: Model, database: str | os.PathLike[str] | None) -> AbstractContextManager[Database]:
    store = nullcontext(own) if database is None else Database.open(database, read_only=True)
    if database is None:
        own.check_model(model)
    return store


def _models(
    database: Database, category: str, config: GeneralizationConfig, report: Callable[[str], None]
) -> Iterator[Target]:
    for model_id in limited(database.model_ids(category), config.limit, config.seed):
        try:
            yield make_target(database.entry(model_id).mesh, model_id, config.seed)
        except MeshError as error:
            report(f"left out: {error}")


def _header(
    model: Model,
    places: Sequence[str | os.PathLike[str]],
    database: str | os.PathLike[str] | None,
    config: GeneralizationConfig,
) -> dict[str, Any]:
    return {
        "table": KIND,
        "seed": config.seed,
        "unit": UNIT,
        "frame": FRAME,
        "models": {model.name: provenance(model)},
        "databases": {model.name: "the targets' own sources" if database is None else str(database)},
        "protocol": {
            "split": config.split,
            "limit": config.limit,
            "top_k": sorted(set(config.top_k)),
            "templates": config.templates,
            "held_out": sorted(config.held_out),
        },
        "data": [{"file": file.name, "sha256": content_hash(file)} for file in _files(places)],
        "database_models": {},
        "versions": versions(),
    }
