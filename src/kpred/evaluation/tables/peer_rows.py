"""Rows of other methods in a table: any `Method` (`kpred.evaluation.methods`), on the targets that the table has.

A method's results count as `feed_forward`, so that `kpred evaluate compare` pairs them with those of the models.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from kpred.errors import ConfigError
from kpred.evaluation.methods import Method, evaluate_methods
from kpred.evaluation.searched import Progress
from kpred.evaluation.tables.make_table import TableConfig
from kpred.evaluation.tables.rows import WHOLE
from kpred.evaluation.tables.table import Series, Subject, Table

METHOD = "feed_forward"


def add_methods(
    table: Table,
    packs: Sequence[str | os.PathLike[str]],
    methods: Mapping[str, tuple[Method, Mapping[str, Any]]],
    config: TableConfig,
    *,
    progress: Progress | None = None,
    report: Callable[[str], None] = lambda sentence: None,
) -> None:
    """Measure methods on a table's targets and put them into it.

    Args:
        packs: those of the table; methods: by the name that they have in the table, with facts for the header.
        config: of the table.

    Raises:
        ConfigError: a name is taken by a model.
        PackError, ModelError: see `kpred.evaluation.methods.evaluate_methods`.
    """
    taken = sorted(set(methods) & set(table.header["models"]))
    if taken:
        raise ConfigError(f"There is a model and a method named {', '.join(taken)}; name them apart.")
    partial = config.kind == "partial"
    _, instances = evaluate_methods(
        packs,
        [method for method, _ in methods.values()],
        split=config.split,
        top_k=config.top_k,
        occlusions=config.occlusions if partial else None,
        limit=config.limit,
        seed=config.seed,
        progress=progress,
        report=report,
    )
    known = set(table.subjects())
    names = {method.name: name for name, (method, _) in methods.items()}
    for instance in instances:
        subject = Subject(instance.dataset, instance.category, instance.target)
        if subject in known:
            score = instance.score
            ending = WHOLE if score.metric.endswith(WHOLE) else ""
            series = Series(
                names[score.metric.removesuffix(WHOLE)],
                METHOD + ending,
                score.protocol,
                score.occlusion,
                score.distance,
                score.top_k,
            )
            table.add(series, subject, score.value)
    table.header["models"].update({name: dict(facts) for name, (_, facts) in methods.items()})
