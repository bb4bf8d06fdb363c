"""What the commands of `kpred evaluate table` share: options, how models are named, and how a table is printed."""

from __future__ import annotations

import time
from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, UseAppendAction, arg

from kpred.cli.command import Command
from kpred.cli.output import Output
from kpred.cli.usage import UsageError

if TYPE_CHECKING:
    from kpred.evaluation.metrics.intervals import Interval
    from kpred.evaluation.tables.make_table import TableConfig
    from kpred.evaluation.tables.table import Cell, Series, Table

BUNDLED = "bundled"


@dataclass(frozen=True, kw_only=True)
class TableCommand(Command):
    """What all tables share."""

    packs: Annotated[Positional[tuple[Path, ...]], arg(metavar="PACK [PACK ...]", help_behavior_hint="")]
    """Mesh packs (.npz), or folders of them; a data set is named after its folder"""
    output: Annotated[Path | None, arg(aliases=["-o"], metavar="FILE")] = None
    """Write FILE.json (all), FILE.csv (the table) and FILE.targets.csv (target by target)"""
    seed: Annotated[int, arg(metavar="SEED")] = 0
    """Of targets, planes, sampling and intervals; the same arguments give the same values"""

    def check(self) -> None:
        """Refuse what cannot work before any work is done."""
        from kpred.evaluation.tables.table import table_files

        if not self.packs:
            raise UsageError("no pack was named; try `kpred evaluate table full FILE.npz`")
        if self.output is not None:
            table_files(self.output)

    def finish(self, output: Output, table: Table, seconds: float, show: Callable[[Output, Table], None]) -> None:
        """Write, print, and list what was left out."""
        from kpred.evaluation.tables.table import write_table

        table.header["command"], table.header["seconds"] = output.command, round(seconds, 1)
        written = write_table(table, self.output) if self.output is not None else ()
        output.result(table.to_json())
        show(output, table)
        remarks = [str(sentence) for sentence in table.header.get("remarks", [])]
        if remarks:
            output.note(f"note: remarks: {len(remarks)}, all of them in the file that -o writes")
        for sentence in remarks[:10]:
            output.note(f"  {sentence}")
        if len(remarks) > 10:
            output.note(f"  and {len(remarks) - 10} more")
        for file in written:
            output.note(f"wrote {file}")


@dataclass(frozen=True, kw_only=True)
class PackTableCommand(TableCommand):
    """What tables of mesh packs share."""

    split: Annotated[str, arg(metavar="NAME")] = "val"
    """Whose shapes are the targets"""
    limit: Annotated[int | None, arg(metavar="N")] = None
    """At most so many targets a pack, drawn at random by the seed"""


@dataclass(frozen=True, kw_only=True)
class ModelOptions(Command):
    """Which models are measured or shown, and what they search."""

    model: Annotated[UseAppendAction[tuple[str, ...]], arg(metavar="NAME=FOLDER", help_behavior_hint="repeatable")] = ()
    """Trained networks and their name in the table; without any, the bundled ones"""
    database: Annotated[
        UseAppendAction[tuple[str, ...]], arg(metavar="NAME=FILE", help_behavior_hint="repeatable")
    ] = ()
    """Database (.kpred) that a model searches; without it, one built from the split `source` of each pack"""
    cache: Annotated[Path | None, arg(metavar="FOLDER")] = None
    """Keep the databases that are built in this folder, for the next table"""

    def named_models(self) -> dict[str, str | None]:
        """Return models by their name in the table."""
        return dict(named(self.model, "model")) or {BUNDLED: None}

    def named_databases(self) -> dict[str, str]:
        """Return databases by the name of the model that searches them."""
        models = self.named_models()
        found = dict(named(self.database, "database")) if self.database else {}
        for name in found:
            if name not in models:
                raise UsageError(f"--database names the model {name}, but the models are {', '.join(models)}")
        return found


def named(words: Sequence[str], option: str) -> list[tuple[str, str]]:
    """Parse words NAME=PATH of an option that can be given several times; the name may be missing."""
    pairs = []
    for word in words:
        name, equals, value = word.partition("=")
        if not equals and option == "model":
            name, value = Path(word).name if word != BUNDLED else BUNDLED, word
        if not name or not value:
            raise UsageError(f"--{option} must be NAME=PATH, but is {word!r}")
        pairs.append((name, value))
    names = [name for name, _ in pairs]
    for name in names:
        if names.count(name) > 1:
            raise UsageError(f"--{option} names {name} twice; give each a name of its own, as in --{option} NAME=PATH")
    return pairs


@dataclass(frozen=True, kw_only=True)
class MeasuredCommand(PackTableCommand, ModelOptions):
    """Tables that measure the targets of packs by one plan."""

    targets: Annotated[Path | None, arg(metavar="FILE")] = None
    """Only the targets named in this file: another table (.json), a split file (.csv with modelId and split), or one id
    a line"""

    peer: Annotated[UseAppendAction[tuple[str, ...]], arg(metavar="NAME=FOLDER", help_behavior_hint="repeatable")] = ()
    """Weights of a peer (`kpred train peer`) and its name in the table; its row counts as feed-forward"""

    def named_peers(self) -> list[tuple[str, str]]:
        """Return folders of peers by their name in the table."""
        return named(self.peer, "peer")

    @abstractmethod
    def config(self) -> TableConfig:
        """Return the plan."""

    @abstractmethod
    def show(self, output: Output, table: Table) -> None:
        """Print the table."""

    def run(self, output: Output) -> None:
        """Measure with a progress bar, print and write."""
        from kpred.cli.progress import ProgressBar
        from kpred.evaluation.tables.make_table import make_table
        from kpred.evaluation.tables.peer_rows import add_methods
        from kpred.evaluation.tables.target_lists import read_target_list
        from kpred.peers.methods.peers import peer_method

        self.check()
        self.named_peers()
        models, databases, config = self.named_models(), self.named_databases(), self.config()
        if self.targets is not None:
            config = replace(config, only=read_target_list(self.targets, self.split))
        began = time.perf_counter()
        with ProgressBar() as bar:
            table = make_table(
                self.packs,
                models,
                config,
                databases,
                cache=self.cache,
                progress=bar.update,
                # They are in the header, and printed with the table.
                report=lambda sentence: None,
            )
            if self.peer:
                peers = {name: peer_method(name, folder) for name, folder in self.named_peers()}
                add_methods(table, self.packs, peers, config, progress=bar.update)
        self.finish(output, table, time.perf_counter() - began, self.show)


SHORT = {
    "chamfer_distance": "CD",
    "unilateral_chamfer_distance": "UCD",
    "unilateral_chamfer_distance_of_whole_surface": "UCD, whole",
}
"""Names of distances in printed tables."""

NOTE = "note: means over the targets and 95 % bootstrap intervals; the paper's numbers are most likely 10^2 times these"


def shown(found: Cell | Interval | None) -> str:
    """Format a value with its interval."""
    if found is None:
        return ""
    series = getattr(found, "series", None)
    digits = 5 if series is not None and series.unit not in ("share", "1") else 2
    if found.low is None or found.high is None:
        return f"{found.value:.{digits}f}"
    return f"{found.value:.{digits}f} ({found.low:.{digits}f}–{found.high:.{digits}f})"


def label(series: Series) -> str:
    """Return the printed name of a series."""
    return series.method.removesuffix("_whole").replace("_", " ")


def errors_of(table: Table, dataset: str) -> list[Series]:
    """List the series that are distances of results from targets."""
    return [one for one in table.series(dataset) if one.is_error]


def print_hint(output: Output, table: Table, dataset: str) -> None:
    """Print the error of whole shapes without the hint that nothing is hidden, against that with it."""
    categories = table.categories(dataset)
    pairs = [
        (one, other)
        for one in errors_of(table, dataset)
        for other in errors_of(table, dataset)
        if (one.method, other.method) == ("structure_without_hint", "structure")
        and (one.model, one.top_k) == (other.model, other.top_k)
    ]
    if pairs:
        output.table(
            f"{dataset}, whole shapes: CD of structure without the hint that nothing is hidden / with it",
            ["model", *categories],
            [
                [one.model, *(shown(table.ratio(one, other, dataset, name)) for name in categories)]
                for one, other in pairs
            ],
        )


def print_pivot(
    output: Output,
    table: Table,
    dataset: str,
    title: str,
    heads: Sequence[str],
    series: Sequence[Series],
    row: Callable[[Series], tuple[str, ...]],
    column: Callable[[Series], str],
    category: str,
) -> None:
    """Print the cells of one category: `row` and `column` say where each series stands, `heads` name the rows."""
    columns = list(dict.fromkeys(column(one) for one in series))
    rows: dict[tuple[str, ...], dict[str, str]] = {}
    for one in series:
        rows.setdefault(row(one), {})[column(one)] = shown(table.cell(one, dataset, category))
    output.table(
        title,
        [*heads, *columns],
        [[*name, *(cells.get(column_name, "") for column_name in columns)] for name, cells in rows.items()],
    )
