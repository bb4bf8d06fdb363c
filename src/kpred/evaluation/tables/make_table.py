"""The paper's tables on mesh packs: whole and partial shapes, how the number of candidates counts, how retrieval ranks.

Each is a plan of measurements (`kpred.evaluation.tables.measuring`) whose values, target by target, become a `Table`.
Several models stand in one table, measured on the same targets against databases of the same shapes.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from kpred.errors import ConfigError, PackError
from kpred.evaluation.header import made_by, versions
from kpred.evaluation.searched import SOURCE_SPLIT, Progress, content_hash
from kpred.evaluation.tables.measuring import (
    Plan,
    SourcePack,
    Store,
    checked_packs,
    measure_pack,
    numbers,
    pack_files,
    steps_of,
)
from kpred.evaluation.tables.protocols import FULL, PARTIAL
from kpred.evaluation.tables.ranking import add_rankings
from kpred.evaluation.tables.rows import FRAME, UNIT
from kpred.evaluation.tables.table import Series, Subject, Table
from kpred.evaluation.tables.target_lists import listed
from kpred.fitting import RefineConfig
from kpred.nn import Model, load_model
from kpred.refinement.structure_config import StructureConfig

OCCLUSIONS = (0.0, 0.25, 0.5, 0.75)
TOP_K = (1, 5, 10, 25)


@dataclass(frozen=True)
class TableConfig:
    """What a table measures, beside its models and packs.

    Attributes:
        kind: `full`: whole shapes, CD. `partial`: shapes cut by a plane, UCD at each of `occlusions`. `topk`: whole
            shapes, the best of each of `top_k`. `oracle`: how well retrieval ranks
            (`kpred.evaluation.tables.ranking`), of whole shapes, and of shapes cut by a plane where there are
            `occlusions`. `scan2cad`: see `kpred.evaluation.tables.scan2cad_table`.
        split, limit, seed: which targets; `limit` of each pack, drawn by seed, None for all.
        top_k: how many retrieved models are deformed and compared.
        occlusions: shares hidden, for `partial`.
        oracle: compare all of the database too.
        unknown_frame: fit every target too where its frame must be found.
        refinement: for the models and for the baseline alike; structure: of the structure-keeping deformation.
        only: ids of the targets, where they are named (`kpred.evaluation.tables.target_lists`).
    """

    kind: str = "full"
    split: str = "val"
    limit: int | None = None
    seed: int = 0
    top_k: tuple[int, ...] = (10,)
    occlusions: tuple[float, ...] = OCCLUSIONS
    oracle: bool = False
    unknown_frame: bool = False
    refinement: RefineConfig = field(default_factory=RefineConfig)
    structure: StructureConfig = field(default_factory=StructureConfig)
    only: frozenset[str] | None = None

    @property
    def steps(self) -> tuple[tuple[str, float], ...]:
        """(protocol, occlusion) of each measurement.

        Raises:
            ConfigError: an occlusion is no share that can be hidden.
        """
        if self.kind == "scan2cad":
            return ((PARTIAL, 0.0),)
        if self.kind == "oracle":
            return (*steps_of(FULL, ()), *(steps_of(PARTIAL, self.occlusions) if self.occlusions else ()))
        return steps_of(PARTIAL if self.kind == "partial" else FULL, self.occlusions)

    def plan(self, cache: Path | None, baselines: bool = True) -> Plan:
        """How each target is measured.

        Raises:
            ConfigError: a setting has an impossible value.
        """
        return Plan(
            numbers(self.top_k),
            self.steps,
            self.split,
            self.limit,
            self.seed,
            self.oracle,
            self.refinement,
            baselines=baselines,
            unknown_frame=self.unknown_frame,
            cache=cache,
            only=self.only,
            structure=self.structure,
        )


def _warn(message: str) -> None:
    warnings.warn(message, stacklevel=3)


def make_table(
    packs: Sequence[str | os.PathLike[str]],
    models: Mapping[str, Model | str | os.PathLike[str] | None],
    config: TableConfig,
    databases: Mapping[str, Store] | None = None,
    *,
    cache: Path | None = None,
    progress: Progress | None = None,
    report: Callable[[str], None] = _warn,
) -> Table:
    """Measure models on the same targets, beside what needs no model.

    Args:
        packs: files of mesh packs, or folders of them; the name of a file's folder is the name of its data set.
        models: by the name that they have in the table; a model, or its name or folder.
        databases: of models that shall not search the pack's split `source`.
        cache: folder that keeps the databases that are built, for the next table.
        report: called with one sentence for each shape left out; the header keeps them as well.

    Raises:
        PackError: a pack is missing, damaged, or has no shapes of a needed split.
        ModelError, DatabaseError: they are missing, do not fit each other, or do not know a pack's category.
        ConfigError: a setting has an impossible value.
    """
    stores = dict(databases or {})
    plan = config.plan(cache)
    loaded = loaded_models(models)
    sources = checked_packs(
        pack_files(packs), list(loaded.values()), config.split, any(stores.get(name) is None for name in loaded)
    )
    remarks: list[str] = []

    def tell(sentence: str) -> None:
        remarks.append(sentence)
        report(sentence)

    sources = _named_in(sources, config, tell)
    table = Table(header_of(loaded, sources, config, stores) | {"remarks": remarks})
    add = add_rankings if config.kind == "oracle" else add_measured
    for source, facts in zip(sources, table.header["data"], strict=True):
        facts["searched"] = add(table, source, loaded, stores, plan, progress, tell)
    return table


def _named_in(sources: list[SourcePack], config: TableConfig, report: Callable[[str], None]) -> list[SourcePack]:
    """The packs that have a named target; names that no pack has are counted and listed."""
    if config.only is None:
        return sources
    there = [set(one.pack.model_id[one.pack.indices(config.split)].tolist()) & config.only for one in sources]
    absent = sorted(config.only - set().union(*there))
    if absent:
        report(f"{len(absent)} of {len(config.only)} named targets are in no pack's '{config.split}': {listed(absent)}")
    found = [one for one, mine in zip(sources, there, strict=True) if mine]
    if not found:
        raise PackError(f"None of the {len(config.only)} named targets is in the split '{config.split}' of a pack.")
    return found


def add_measured(
    table: Table,
    source: SourcePack,
    models: Mapping[str, Model],
    databases: Mapping[str, Store],
    plan: Plan,
    progress: Progress | None,
    report: Callable[[str], None],
) -> str:
    """Put the scores of one pack's targets into a table; returns a hash of what was searched."""
    found = measure_pack(source, models, databases, plan, progress, report)
    for target in found:
        subject = Subject(source.dataset, source.pack.category, target.model_id)
        for model, score in target.scores:
            series = Series(
                model, score.metric, score.protocol, score.occlusion, score.distance, score.top_k, score.unit
            )
            table.add(series, subject, score.value)
    return found[0].searched


def loaded_models(models: Mapping[str, Model | str | os.PathLike[str] | None]) -> dict[str, Model]:
    """Models by name; names and folders are loaded.

    Raises:
        ConfigError: there is none, or one has no name.
        ModelError: one cannot be loaded.
    """
    if not models or not all(models):
        raise ConfigError("A table needs at least one model, and a name for each; give NAME=FOLDER.")
    return {name: model if isinstance(model, Model) else load_model(model) for name, model in models.items()}


def header_of(
    models: Mapping[str, Model], packs: Sequence[SourcePack], config: TableConfig, databases: Mapping[str, Store]
) -> dict[str, Any]:
    """What a table is made by, as plain values.

    `protocol` and `data` are what two tables must have in common to be compared.
    """
    return {
        "table": config.kind,
        "seed": config.seed,
        "unit": UNIT,
        "frame": FRAME,
        "models": {name: made_by(model) for name, model in models.items()},
        "databases": {name: _searched(databases.get(name)) for name in models},
        "protocol": protocol_of(config),
        "data": [
            {
                "dataset": pack.dataset,
                "category": pack.pack.category,
                "file": pack.file.name,
                "sha256": content_hash(pack.file),
                "source": int(len(pack.pack.indices(SOURCE_SPLIT))),
                "targets": int(len(pack.pack.indices(config.split))),
            }
            for pack in packs
        ],
        "note": "values and means over instances are as defined; the numbers of the paper's tables are most likely "
        "10^2 times these",
        "versions": versions(),
    }


def protocol_of(config: TableConfig) -> dict[str, Any]:
    """All settings that a value depends on, beside model and data."""
    values = asdict(config)
    values["top_k"], values["occlusions"] = list(config.top_k), list(config.occlusions)
    values["only"] = None if config.only is None else sorted(config.only)
    if config.kind in ("full", "topk", "scan2cad"):
        values.pop("occlusions")
    return values


def _searched(database: Store) -> str:
    if database is None:
        return f"built from the split '{SOURCE_SPLIT}' of each pack"
    return str(getattr(database, "path", database))
