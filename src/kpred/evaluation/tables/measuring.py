"""The targets of one mesh pack, measured: what needs no model once, then every model on the same targets."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

import torch

from kpred.database import Database
from kpred.errors import ConfigError, PackError
from kpred.evaluation.scans.outcomes import Fitting
from kpred.evaluation.searched import SOURCE_SPLIT, Progress, counter, searched
from kpred.evaluation.tables.baselines import NoLearning
from kpred.evaluation.tables.frame_protocol import measure_fits
from kpred.evaluation.tables.protocols import FULL, PARTIAL, Bench, measure
from kpred.evaluation.tables.rows import Score
from kpred.evaluation.tables.table import ALL, NO_MODEL
from kpred.evaluation.tables.targets import Target, read_targets
from kpred.fitting import RefineConfig
from kpred.nn import Model
from kpred.refinement.structure_config import StructureConfig
from kpred.shapes import MeshPack

Store = Database | str | os.PathLike[str] | None


@dataclass(frozen=True)
class Plan:
    """How targets are measured.

    Attributes:
        top_k: numbers of models to compare; steps: (protocol, occlusion) of each measurement of a target.
        split, limit, seed: which targets, as `read_targets` takes them.
        oracle: whether all of the database is deformed and compared too.
        refinement: for the models and for the baseline alike; structure: of the structure-keeping deformation.
        baselines: whether what needs no model is measured.
        unknown_frame: whether fits that must find the frame are measured beside fits that know it.
        cache: folder that keeps the databases that are built.
        only: ids of the targets, where they are named.
    """

    top_k: tuple[int, ...]
    steps: tuple[tuple[str, float], ...]
    split: str
    limit: int | None
    seed: int
    oracle: bool
    refinement: RefineConfig
    baselines: bool = True
    unknown_frame: bool = False
    cache: Path | None = None
    only: frozenset[str] | None = None
    structure: StructureConfig = field(default_factory=StructureConfig)


@dataclass(frozen=True, eq=False)
class SourcePack:
    """A mesh pack and where it comes from; its data set is named after the folder."""

    file: Path
    pack: MeshPack

    @property
    def dataset(self) -> str:
        """Name of the data set."""
        return self.file.resolve().parent.name


@dataclass(frozen=True, eq=False)
class Measured:
    """All scores of one target, each with the name of the model it is of (none for baselines).

    `database_models`: how many shapes were searched; `searched`: a hash of their ids.
    """

    model_id: str
    database_models: int
    searched: str
    scores: list[tuple[str, Score]]


def pack_files(packs: Sequence[str | os.PathLike[str]]) -> list[Path]:
    """The files themselves, and the .npz files of folders in the order of their names.

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
    """All packs, read: what is wrong with the last must not come out after an hour's work on the first.

    Raises:
        PackError: one is missing, damaged, or has no shapes of a needed split.
        ModelError: a model does not know a pack's category.
    """
    packs = [SourcePack(file, MeshPack.load(file)) for file in files]
    for one in packs:
        for model in models:
            model[one.pack.category]
        if not len(one.pack.indices(split)):
            found = ", ".join(sorted(set(one.pack.split.tolist()))) or "none"
            raise PackError(f"{one.file}: no shape is in the split '{split}'; its splits are {found}.")
        if needs_source and not len(one.pack.indices(SOURCE_SPLIT)):
            raise PackError(f"{one.file}: no shape is in the split '{SOURCE_SPLIT}' to search; give a database.")
    return packs


@dataclass(frozen=True, eq=False)
class OpenPack:
    """A pack's targets and what they are measured against.

    Attributes:
        name: data set and category, for progress; category: of the pack.
        targets: of the plan's split; stores: the database of each model; baseline: the same shapes without a model.
    """

    name: str
    category: str
    targets: list[Target]
    stores: dict[str, Database]
    baseline: NoLearning

    @property
    def searched(self) -> str:
        """A hash of the ids of the shapes that are searched."""
        return hashlib.sha256("\n".join(self.baseline.model_ids).encode()).hexdigest()[:16]


@contextmanager
def open_pack(
    source: SourcePack,
    models: Mapping[str, Model],
    databases: Mapping[str, Store],
    plan: Plan,
    progress: Progress | None,
    report: Callable[[str], None],
) -> Iterator[OpenPack]:
    """Targets, databases and the baseline of one pack; the databases are closed at the end.

    Args:
        models: by name, at least one; databases: of each, None for one built from the pack's split `source`.
        report: called with one sentence for each shape left out, and when targets are in the database.

    Raises:
        PackError: no target has a surface.
        DatabaseError: a database is missing, was made by other weights, or has none of the category.
        ConfigError: the databases of the models hold different shapes.
    """
    category, name = source.pack.category, f"{source.dataset}/{source.pack.category}"
    targets = read_targets(source.pack, str(source.file), plan.split, plan.limit, plan.seed, report, plan.only)
    with ExitStack() as stack:
        stores: dict[str, Database] = {}
        for model_name, model in models.items():
            beside = f" of {model_name}" if len(models) > 1 else ""
            building = counter(progress, f"{name}: database{beside}", len(source.pack.indices(SOURCE_SPLIT)))
            # Broken shapes are the same for every model.
            tell = report if not stores else _silent
            opened = searched(
                [source.file], model, databases.get(model_name), plan.seed, building, tell, cache=plan.cache
            )
            stores[model_name] = stack.enter_context(opened)
        check_same_shapes(stores, category)
        arrays = next(iter(stores.values())).candidates(category)
        known = set(arrays.model_ids) & {target.model_id for target in targets}
        if known:
            report(
                f"{source.file}: {len(known)} of {len(targets)} targets are in the database; their errors say little."
            )
        shapes = torch.from_numpy(arrays.points)
        # Made where it is not measured too: it holds the shapes.
        making = counter(progress, f"{name}: baseline", len(shapes))
        baseline = (
            NoLearning.build(arrays.model_ids, category, shapes, making)
            if plan.baselines
            else NoLearning(arrays.model_ids, category, shapes, shapes.new_zeros(0))
        )
        yield OpenPack(name, category, targets, stores, baseline)


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


def measure_pack(
    source: SourcePack,
    models: Mapping[str, Model],
    databases: Mapping[str, Store],
    plan: Plan,
    progress: Progress | None,
    report: Callable[[str], None],
) -> list[Measured]:
    """Scores of all targets of one pack; see `open_pack` for arguments and errors.

    A fit that must find the frame and cannot is told to `report` and has no score.
    """
    found: list[Measured] = []
    with open_pack(source, models, databases, plan, progress, report) as pack:
        benches = _benches(pack, models, plan)
        for target in pack.targets:
            scores: list[tuple[str, Score]] = []
            for protocol, occlusion in plan.steps:
                for name, bench in benches:
                    with torch.inference_mode():
                        scores += [(name, score) for score in measure(target, bench, protocol, occlusion)]
                for name in models if plan.unknown_frame else ():
                    how = Fitting(models[name], pack.stores[name], max(plan.top_k), plan.seed)
                    settings = plan.refinement, plan.structure
                    fits = measure_fits(target, pack.category, how, settings, protocol, occlusion, report)
                    scores += [(name, score) for score in fits]
            found.append(Measured(target.model_id, len(pack.baseline.points), pack.searched, scores))
            if progress is not None:
                progress(f"{pack.name}: {plan.split}", len(found), len(pack.targets))
    return found


def _benches(pack: OpenPack, models: Mapping[str, Model], plan: Plan) -> list[tuple[str, Bench]]:
    """Of the baselines, under no name, then of each model."""
    benches = [
        (
            name,
            Bench(
                model,
                pack.stores[name],
                pack.baseline,
                plan.top_k,
                plan.refinement,
                plan.structure,
                plan.oracle,
                baselines=False,
            ),
        )
        for name, model in models.items()
    ]
    if not plan.baselines:
        return benches
    return [(NO_MODEL, replace(benches[0][1], baselines=True, learned=False)), *benches]


def numbers(top_k: int | Sequence[int]) -> tuple[int, ...]:
    """Numbers of models to compare, each once, in ascending order.

    Raises:
        ConfigError: there is none, or one below 1.
    """
    found = (top_k,) if isinstance(top_k, int) else tuple(top_k)
    if not found or min(found) < 1:
        raise ConfigError(f"top_k must be at least 1, but is {', '.join(map(str, found)) or 'empty'}.")
    return tuple(sorted(set(found)))


def steps_of(protocol: str, occlusions: Sequence[float]) -> tuple[tuple[str, float], ...]:
    """(protocol, occlusion) of each measurement of a target.

    Raises:
        ConfigError: there is no such protocol, or an occlusion is no share that can be hidden.
    """
    if protocol not in (FULL, PARTIAL, ALL):
        raise ConfigError(f"The protocol must be one of {FULL}, {PARTIAL}, {ALL}, but is '{protocol}'.")
    steps = [] if protocol == PARTIAL else [(FULL, 0.0)]
    if protocol != FULL:
        # Below some fifty points there is nothing to fit a shape to.
        if not occlusions or not all(0 <= share <= 0.95 for share in occlusions):
            raise ConfigError(f"Occlusions must be shares from 0 to 0.95, but are {list(occlusions)}.")
        steps += [(PARTIAL, float(share)) for share in occlusions]
    return tuple(steps)


def _silent(sentence: str) -> None:
    pass
