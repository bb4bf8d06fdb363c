"""The paper's tables on mesh packs: whole and partial shapes, how the number of candidates counts, how retrieval ranks.

Several models and other methods stand in one table, measured on the same targets against the same shapes.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from kpred.errors import PackError
from kpred.evaluation.database_source import SOURCE_SPLIT, Progress, content_hash, counter
from kpred.evaluation.header import models_of, processor, versions
from kpred.evaluation.methods.kp_red import KpRedMethod
from kpred.evaluation.methods.method import Method
from kpred.evaluation.methods.no_learning import NoLearningMethod
from kpred.evaluation.methods.sources import Sources
from kpred.evaluation.methods.whole_fit import WholeFitMethod
from kpred.evaluation.metrics.metric import FRAME, UNIT
from kpred.evaluation.remarks import Remarks
from kpred.evaluation.tables.config import TableConfig
from kpred.evaluation.tables.packs import OpenPack, SourcePack, Store, checked_packs, open_pack, pack_files
from kpred.evaluation.tables.ranking import add_rankings
from kpred.evaluation.tables.scorer import Scorer, check_names, prepare
from kpred.evaluation.tables.table import Subject, Table
from kpred.evaluation.tables.target_lists import listed
from kpred.nn import Model, load_model
from kpred.shapes.source import warn

NOTE = (
    "values and means over instances are as defined; the numbers of the paper's tables are most likely 10^2 times these"
)


def make_table(
    packs: Sequence[str | os.PathLike[str]],
    models: Mapping[str, Model | str | os.PathLike[str] | None],
    config: TableConfig,
    databases: Mapping[str, Store] | None = None,
    *,
    methods: Sequence[Method] = (),
    cache: Path | None = None,
    progress: Progress | None = None,
    report: Callable[[str], None] = warn,
) -> Table:
    """Measure models and other methods on the same targets, beside what needs no model.

    Args:
        packs: files of mesh packs, or folders of them; the name of a file's folder is the name of its data set.
        models: by the name that they have in the table; a model, or its name or folder.
        databases: of models that shall not search the pack's split `source`.
        methods: others than this package's; they search the pack's split `source`.
        cache: folder that keeps the databases that are built, for the next table.
        report: called with one sentence for each shape left out; the header keeps them as well.

    Raises:
        PackError: a pack is missing, damaged, or has no shapes of a needed split.
        ModelError, DatabaseError: they are missing, do not fit each other, or do not know a pack's category.
        ConfigError: a setting has an impossible value, or two models or methods have one name.
    """
    stores = dict(databases or {})
    check_names([*models, *(method.name for method in methods)])
    loaded = loaded_models(models)
    needs_source = bool(methods) or any(stores.get(name) is None for name in loaded)
    sources = checked_packs(pack_files(packs), list(loaded.values()), config.split, needs_source)
    remarks = Remarks(report)
    sources = _named_in(sources, config, remarks)
    table = Table(header_of(loaded, sources, config, stores, methods) | {"remarks": remarks.sentences})
    sizes = table.header["database_models"] = {}
    for source, facts in zip(sources, table.header["data"], strict=True):
        with open_pack(source, loaded, stores, config, cache, progress, remarks) as pack:
            facts["searched"], sizes[source.name] = pack.sources.digest, len(pack.sources)
            if config.kind == "oracle":
                add_rankings(table, pack, loaded, config, progress)
            else:
                add_scores(table, pack, loaded, config, progress, remarks, methods)
    return table


def add_scores(
    table: Table,
    pack: OpenPack,
    models: Mapping[str, Model],
    config: TableConfig,
    progress: Progress | None,
    report: Callable[[str], None],
    methods: Sequence[Method] = (),
    baselines: bool = True,
) -> None:
    """Put the scores of one pack's targets into a table.

    Args:
        methods: others than models; baselines: whether what needs no model is measured.
        report: called with one sentence for each fit without a result.
    """
    source = pack.source
    making = counter(progress, f"{source.name}: baseline", len(pack.sources))
    first: list[Method] = [NoLearningMethod(config.refinement, making)] if baselines else []
    searchers = prepare([*first, *methods_of(models, config, report)], pack.sources)
    # Part-wise methods need meshes, which the sources of a database lack.
    own = pack.sources if pack.sources.meshes or not methods else _sources_of(source, config)
    searchers += prepare(list(methods), own)
    scorer = Scorer(tuple(searchers), pack.sources if baselines else None, config.numbers, config.oracle)
    for done, target in enumerate(pack.targets, start=1):
        subject = Subject(source.dataset, pack.category, target.model_id)
        for condition in config.conditions:
            for series, value in scorer.score(target, condition, condition.cloud(target)):
                table.add(series, subject, value)
        if progress is not None:
            progress(f"{source.name}: {config.split}", done, len(pack.targets))
    add_seconds(table, [scorer])


def add_seconds(table: Table, scorers: Sequence[Scorer]) -> None:
    """Put the mean time of each row, in seconds of the processor for one target, into a table's header."""
    known = table.header.setdefault("processor_seconds", [])
    rows = {(row["model"], row["method"]): row for row in known}
    for scorer in scorers:
        for (model, method), seconds in scorer.seconds.items():
            if (model, method) not in rows:
                rows[model, method] = {"model": model, "method": method, "n": 0, "mean": 0.0}
                known.append(rows[model, method])
            row, total = rows[model, method], sum(seconds)
            row["mean"] = (row["mean"] * row["n"] + total) / (row["n"] + len(seconds))
            row["n"] += len(seconds)


def methods_of(models: Mapping[str, Model], config: TableConfig, report: Callable[[str], None]) -> list[Method]:
    """List the methods of models: KP-RED of each, then whole fits of each if the frame shall be found."""
    kp_red: list[Method] = [
        KpRedMethod(name, model, config.refinement, config.structure) for name, model in models.items()
    ]
    whole: list[Method] = [
        WholeFitMethod(name, model, config.seed, config.refinement, config.structure, report)
        for name, model in models.items()
    ]
    return kp_red + (whole if config.unknown_frame else [])


def _sources_of(source: SourcePack, config: TableConfig) -> Sources:
    return Sources.of_pack(source.pack, str(source.file), config.seed, lambda sentence: None)


def _named_in(sources: list[SourcePack], config: TableConfig, report: Callable[[str], None]) -> list[SourcePack]:
    """List the packs that have a named target; names that no pack has are counted and reported."""
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


def loaded_models(models: Mapping[str, Model | str | os.PathLike[str] | None]) -> dict[str, Model]:
    """Load models that are given by name or folder.

    Raises:
        ModelError: one cannot be loaded.
    """
    return {name: model if isinstance(model, Model) else load_model(model) for name, model in models.items()}


def header_of(
    models: Mapping[str, Model],
    packs: Sequence[SourcePack],
    config: TableConfig,
    databases: Mapping[str, Store],
    methods: Sequence[Method] = (),
) -> dict[str, Any]:
    """Describe what a table is made by, as plain values.

    `protocol` and `data` are what two tables must have in common to be compared.
    """
    return {
        "table": config.kind,
        "seed": config.seed,
        "unit": UNIT,
        "frame": FRAME,
        "models": models_of(models, methods),
        "databases": {name: _searched(databases.get(name)) for name in models},
        "protocol": config.to_json(),
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
        "note": NOTE,
        "versions": versions(),
        "machine": processor(),
    }


def _searched(database: Store) -> str:
    if database is None:
        return f"built from the split '{SOURCE_SPLIT}' of each pack"
    return str(getattr(database, "path", database))
