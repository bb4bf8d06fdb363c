"""`kpred evaluate table`: one command for each table of the paper."""

from __future__ import annotations

import time
from abc import abstractmethod
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import UseAppendAction, arg

from kpred.cli.command import Group
from kpred.cli.evaluate_ablation import AblationCommand
from kpred.cli.evaluate_scan2cad import Scan2CadCommand
from kpred.cli.output import Output
from kpred.cli.table_options import NOTE, SHORT, ModelOptions, PackTableCommand, label, named, print_pivot, shown

if TYPE_CHECKING:
    from kpred.evaluation.table_data import Series, Table
    from kpred.evaluation.tables import TableConfig


@dataclass(frozen=True, kw_only=True)
class _MeasuredCommand(PackTableCommand, ModelOptions):
    """Tables that measure the targets of packs by one plan."""

    targets: Annotated[Path | None, arg(metavar="FILE")] = None
    """Only the targets named in this file: another table (.json), a split file (.csv with modelId and split), or one id
    a line"""

    peer: Annotated[UseAppendAction[tuple[str, ...]], arg(metavar="NAME=FOLDER", help_behavior_hint="repeatable")] = ()
    """Weights of a peer (`kpred train peer`) and its name in the table; its row counts as feed-forward"""

    def named_peers(self) -> list[tuple[str, str]]:
        """Folders of peers by their name in the table."""
        return named(self.peer, "peer")

    @abstractmethod
    def config(self) -> TableConfig:
        """The plan."""

    @abstractmethod
    def show(self, output: Output, table: Table) -> None:
        """Print the table."""

    def run(self, output: Output) -> None:
        """Measure with a progress bar, print and write."""
        from kpred.cli.progress import ProgressBar
        from kpred.evaluation.methods.peers import peer_method
        from kpred.evaluation.peer_rows import add_methods
        from kpred.evaluation.tables import make_table
        from kpred.evaluation.target_lists import read_target_list

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


@dataclass(frozen=True, kw_only=True)
class FullCommand(_MeasuredCommand):
    """Whole shapes: Chamfer distance, best of the top k (the paper's table of full shapes).

    Rows: what needs no model (two samples of one surface, the true nearest shape as it is, deformation without
    learning), then of each model the nearest retrieved shape as it is, feed-forward (the paper's protocol) and refined.

    examples:
      kpred evaluate table full chair.npz table.npz cabinet.npz -o full.json
      kpred evaluate table full packs/ --model kp-red=runs/kp-red --model kp-red-plus=bundled --limit 100
      kpred evaluate table full packs/ --unknown-frame --oracle --limit 40
    """

    top_k: Annotated[int, arg(metavar="K")] = 10
    """How many retrieved models are deformed and compared"""
    unknown_frame: Annotated[bool, arg(help_behavior_hint="")] = False
    """Fit every target too where its place, size and yaw must be found"""
    oracle: Annotated[bool, arg(help_behavior_hint="")] = False
    """Deform and compare all of the database as well (slow)"""

    def config(self) -> TableConfig:
        """The plan."""
        from kpred.evaluation.tables import TableConfig

        return TableConfig(
            "full",
            self.split,
            self.limit,
            self.seed,
            (self.top_k,),
            oracle=self.oracle,
            unknown_frame=self.unknown_frame,
        )

    def show(self, output: Output, table: Table) -> None:
        """Categories side by side."""
        for dataset in table.datasets():
            categories = table.categories(dataset)
            series = table.series(dataset)
            base = next((one for one in series if one.method == "no_learning"), None)
            output.table(
                f"{dataset}, whole shapes: CD, best of {self.top_k}, {table.header['unit']}, known frame unless told",
                ["model", "method", *categories, "/ no learning"],
                [
                    [
                        one.model,
                        label(one),
                        *(shown(table.cell(one, dataset, category)) for category in categories),
                        "" if base is None else shown(table.ratio(one, base, dataset, categories[-1])),
                    ]
                    for one in series
                ],
            )
        output.note(NOTE)


@dataclass(frozen=True, kw_only=True)
class PartialCommand(_MeasuredCommand):
    """Shapes cut by a random plane: UCD at each share hidden (the paper's occlusion curves).

    UCD is measured from the points that are seen; `UCD, whole` from all of the true surface to the same result.

    examples:
      kpred evaluate table partial chair.npz table.npz cabinet.npz --limit 100 -o partial.json
      kpred evaluate table partial packs/ --occlusions 0 0.5 --unknown-frame --limit 20
    """

    top_k: Annotated[int, arg(metavar="K")] = 10
    """How many retrieved models are deformed and compared"""
    occlusions: Annotated[tuple[float, ...], arg(metavar="SHARE [SHARE ...]")] = (0.0, 0.25, 0.5, 0.75)
    """Shares of the points that are hidden"""
    unknown_frame: Annotated[bool, arg(help_behavior_hint="")] = False
    """Fit every target too where its place, size and yaw must be found"""

    def config(self) -> TableConfig:
        """The plan."""
        from kpred.evaluation.tables import TableConfig

        return TableConfig(
            "partial",
            self.split,
            self.limit,
            self.seed,
            (self.top_k,),
            self.occlusions,
            unknown_frame=self.unknown_frame,
        )

    def show(self, output: Output, table: Table) -> None:
        """Occlusions side by side, a table for each category."""
        for dataset in table.datasets():
            for category in table.categories(dataset):
                print_pivot(
                    output,
                    table,
                    dataset,
                    f"{dataset}, {category}, partial shapes: best of {self.top_k}, {table.header['unit']}",
                    ["distance", "model", "method"],
                    sorted(table.series(dataset), key=lambda one: one.distance),
                    lambda one: (SHORT.get(one.distance, one.distance), one.model, label(one)),
                    lambda one: f"{one.occlusion:.0%} hidden",
                    category,
                )
        output.note(NOTE)


@dataclass(frozen=True, kw_only=True)
class TopKCommand(_MeasuredCommand):
    """Whole shapes: how the number of retrieved models that are deformed and compared counts.

    examples:
      kpred evaluate table topk chair.npz table.npz cabinet.npz --limit 100 -o topk.json
      kpred evaluate table topk packs/ --top-k 1 10 --oracle --limit 20
    """

    top_k: Annotated[tuple[int, ...], arg(metavar="K [K ...]")] = (1, 5, 10, 25)
    """Numbers of retrieved models that are deformed and compared"""
    oracle: Annotated[bool, arg(help_behavior_hint="")] = False
    """Deform and compare all of the database as well (slow)"""

    def config(self) -> TableConfig:
        """The plan."""
        from kpred.evaluation.tables import TableConfig

        return TableConfig("topk", self.split, self.limit, self.seed, self.top_k, oracle=self.oracle)

    def show(self, output: Output, table: Table) -> None:
        """Numbers of candidates side by side, a table for each category."""
        for dataset in table.datasets():
            for category in table.categories(dataset):
                print_pivot(
                    output,
                    table,
                    dataset,
                    f"{dataset}, {category}, whole shapes: CD, {table.header['unit']}, best of the top k",
                    ["model", "method"],
                    table.series(dataset),
                    lambda one: (one.model, label(one).removeprefix("oracle ")),
                    lambda one: "all" if one.top_k is None else f"top {one.top_k}",
                    category,
                )
        output.note(NOTE)


@dataclass(frozen=True, kw_only=True)
class OracleCommand(_MeasuredCommand):
    """How well retrieval ranks: all of the database is deformed and refined to every target.

    The true best is the model of the lowest error after that. Printed: for which share of the targets it is among the
    top k, Spearman's rank correlation with the refined error, and the best of the top k against the oracle; for the
    order by tokens, by feed-forward error and by undeformed distance. Slow: choose a --limit.

    examples:
      kpred evaluate table oracle chair.npz table.npz cabinet.npz --limit 40 -o oracle.json
      kpred evaluate table oracle chair.npz --limit 10 --occlusions 0.5
    """

    limit: Annotated[int | None, arg(metavar="N")] = 40
    """At most so many targets a pack, drawn at random by the seed"""
    top_k: Annotated[tuple[int, ...], arg(metavar="K [K ...]")] = (1, 5, 10, 25)
    """Numbers of retrieved models"""
    occlusions: Annotated[tuple[float, ...], arg(metavar="SHARE [SHARE ...]")] = ()
    """Judge shapes cut by a plane too, with these shares hidden"""

    def config(self) -> TableConfig:
        """The plan."""
        from kpred.evaluation.tables import TableConfig

        return TableConfig("oracle", self.split, self.limit, self.seed, self.top_k, self.occlusions)

    def show(self, output: Output, table: Table) -> None:
        """Orders and numbers of candidates, a table for each category."""
        for dataset in table.datasets():
            for category in table.categories(dataset):
                for title, heads, wanted in _ORACLE_TABLES:
                    print_pivot(
                        output,
                        table,
                        dataset,
                        f"{dataset}, {category}: {title}",
                        heads,
                        [one for one in table.series(dataset) if any(map(one.method.startswith, wanted))],
                        _oracle_row,
                        _oracle_column,
                        category,
                    )
        output.note(NOTE)


_ORACLE_TABLES = (
    (
        "share of targets whose true best after refinement is among the first k; rank correlation with refined error",
        ["model", "hidden", "order by"],
        ("true_best_in_top", "spearman", "rank_of_true_best"),
    ),
    (
        "share of targets with a model within 5 % of the true best among the first k",
        ["model", "hidden", "order by"],
        ("within_5_percent",),
    ),
    (
        "best of the top k by tokens, all refined to the end; unit box squared",
        ["model", "hidden", "method"],
        ("refined", "feed_forward"),
    ),
)


def _oracle_row(series: Series) -> tuple[str, ...]:
    name = series.method.partition("_by_")[2] or series.method
    return series.model, "" if series.protocol == "full" else f"{series.occlusion:.0%}", name.replace("_", " ")


def _oracle_column(series: Series) -> str:
    if series.unit == "1":
        return series.method.partition("_by_")[0].replace("_", " ")
    return "all" if series.top_k is None else f"top {series.top_k}"


TABLES = Group(
    {
        "full": FullCommand,
        "partial": PartialCommand,
        "scan2cad": Scan2CadCommand,
        "ablation": AblationCommand,
        "topk": TopKCommand,
        "oracle": OracleCommand,
    },
    "Make a table of the paper: values, intervals, JSON and CSV.",
)
