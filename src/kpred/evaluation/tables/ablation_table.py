"""The ablation table: rows are trained where they are missing, measured one by one, and kept as they come.

What is measured of a row stays beside its weights, under a name made of weights, data and protocol. A run that was
stopped, in training or in measuring, loses at most the row that it was at.
"""

from __future__ import annotations

import hashlib
import itertools
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from kpred.errors import ConfigError
from kpred.evaluation.database_source import SOURCE_SPLIT, Progress, content_hash
from kpred.evaluation.header import weights_hash
from kpred.evaluation.remarks import Remarks
from kpred.evaluation.tables.compare import Comparison, compare_series
from kpred.evaluation.tables.config import TableConfig
from kpred.evaluation.tables.make_table import add_scores, header_of
from kpred.evaluation.tables.packs import SourcePack, check_split, open_pack, pack_files
from kpred.evaluation.tables.table import Table, merged, read_table, write_table
from kpred.nn import Model, load_model
from kpred.shapes import MeshPack
from kpred.training.ablations import Ablation, AblationRuns

Runs = Callable[[SourcePack, Path, str], AblationRuns]
"""Makes the runs of one pack in a folder; the third argument is a hash of the pack."""

EFFECTS = (
    ("GSA", "a", "c"),
    ("GSA", "b", "e"),
    ("DAR", "c", "e"),
    ("DAR", "d", "f"),
    ("LGF", "c", "d"),
    ("LGF", "e", "f"),
    ("CB", "without-cb", "with-cb"),
)
"""Pairs of rows that differ in one part alone: (part, row without it, row with it)."""


@dataclass(frozen=True)
class Effect:
    """What one part does: `comparison` is of the row with it against the row without it."""

    part: str
    without: str
    having: str
    comparison: Comparison


def make_ablation_table(
    packs: Sequence[str | Path],
    rows: Sequence[Ablation],
    folder: Path,
    runs: Runs,
    config: TableConfig,
    *,
    only_finished: bool = False,
    progress: Progress | None = None,
    report: Callable[[str], None] = lambda sentence: None,
) -> Table:
    """Train what is missing, measure every row, and put all into one table.

    Args:
        packs: one of each category of a data set; the splits `source` and `train` are trained on, `config.split` is
            measured.
        rows: full rows are measured by `config` as the full table is, partial rows at each of `config.occlusions`.
        folder: of all runs; `folder/<data set>/<category>/<row>/`.
        only_finished: train nothing; rows that are not trained are left out and reported.
        report: called with one sentence for what is left out; the header keeps them as well.

    Raises:
        PackError: a pack is missing, damaged, or has no shapes of the split.
        CheckpointError: the folder holds runs by other settings or on other data.
        ConfigError: two packs have the same data set and category.
    """
    sources = _read(packs, config.split)
    # Each row would report the same broken shape.
    remarks = Remarks(report, unique=True)
    # One a pack for all rows: it keeps the prepared shapes.
    trained = {
        source: runs(source, folder / source.dataset / source.pack.category, content_hash(source.file))
        for source in sources
    }
    tables: list[Table] = []
    models: dict[str, Model] = {}
    # Row by row: after the first rows of all categories there is a table already.
    for row in rows:
        for source in sources:
            mine = trained[source]
            if only_finished and not mine.finished(row):
                remarks(f"left out: {source.name}, row {row.name}: it is not trained to the end.")
                continue
            weights = mine.weights(row)
            model = load_model(weights)
            models.setdefault(row.name, Model(str(folder / row.name), {}))
            models[row.name].networks.update(model.networks)
            tables.append(_measured(source, row, model, weights.parent, _config_of(row, config), progress, remarks))
    if not tables:
        raise ConfigError(f"{folder} holds no finished row; train some first.")
    settings = {"rows": [row.name for row in rows], "remarks": remarks.sentences}
    return merged(tables, header_of(models, sources, replace(config, kind="ablation"), {}) | settings)


def _read(packs: Sequence[str | Path], split: str) -> list[SourcePack]:
    """Read and check all packs, one of each category of a data set."""
    sources = [SourcePack(file, MeshPack.load(file)) for file in pack_files(packs)]
    if len({source.name for source in sources}) < len(sources):
        raise ConfigError("Two packs are of one data set and category; give one pack of each.")
    for source in sources:
        for needed in (SOURCE_SPLIT, split):
            check_split(source.file, source.pack, needed)
    return sources


def effects(table: Table) -> list[Effect]:
    """Compare all pairs of measured rows that differ in one part alone."""
    found = []
    for (part, without, having), dataset in itertools.product(EFFECTS, table.datasets()):
        category = table.categories(dataset)[-1]
        for series, values in table.values.items():
            other = replace(series, model=having)
            if series.model == without and series.is_error and other in table.values:
                seed = int(table.header.get("seed", 0))
                comparison = compare_series(series, dataset, category, values, table.values[other], seed)
                if comparison is not None:
                    found.append(Effect(part, without, having, comparison))
    return found


def _config_of(row: Ablation, config: TableConfig) -> TableConfig:
    return replace(config, kind="partial" if row.partial else "full")


def _measured(
    source: SourcePack,
    row: Ablation,
    model: Model,
    folder: Path,
    config: TableConfig,
    progress: Progress | None,
    report: Callable[[str], None],
) -> Table:
    """Measure a row on one pack, or read its values from its folder."""
    network = model[source.pack.category]
    header = header_of({row.name: model}, [source], config, {})
    made_of = json.dumps([header["protocol"], header["data"], weights_hash(network), header["versions"]["kpred"]])
    file = folder / f"measured-{hashlib.sha256(made_of.encode()).hexdigest()[:16]}.json"
    if file.exists():
        table = read_table(file)
        for sentence in table.header.get("remarks", []):
            report(sentence)
        return table
    remarks = Remarks(report)
    table = Table(header | {"remarks": remarks.sentences})
    label = f"row {row.name}, "
    named = None if progress is None else lambda task, done, total: progress(label + task, done, total)
    models = {row.name: model}
    with open_pack(source, models, {}, config, None, named, remarks) as pack:
        add_scores(table, pack, models, config, named, remarks, baselines=False)
    write_table(table, file)
    return table
