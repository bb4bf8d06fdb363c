"""`kpred evaluate table`: one command for each table of the paper."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

from tyro.conf import arg

from kpred.cli.command import Group
from kpred.cli.evaluate_ablation import AblationCommand
from kpred.cli.evaluate_cleanliness import print_cleanliness_of
from kpred.cli.evaluate_oracle import OracleCommand
from kpred.cli.evaluate_scan2cad import Scan2CadCommand
from kpred.cli.output import Output
from kpred.cli.table_options import NOTE, SHORT, MeasuredCommand, errors_of, label, print_hint, print_pivot, shown

if TYPE_CHECKING:
    from kpred.evaluation.tables.make_table import TableConfig
    from kpred.evaluation.tables.table import Table


@dataclass(frozen=True, kw_only=True)
class FullCommand(MeasuredCommand):
    """Whole shapes: Chamfer distance, best of the top k (the paper's table of full shapes).

    Rows: what needs no model (two samples of one surface, the true nearest shape as it is, deformation without
    learning), then of each model the nearest retrieved shape as it is, feed-forward (the paper's protocol), with
    refined keypoints, and by structure (what a fit delivers by default), with the hint that nothing is hidden, and
    without. A second table says how far the deformed meshes are still flat, square, mirrored and joined.

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
        """Return the plan."""
        from kpred.evaluation.tables.make_table import TableConfig

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
        """Return categories side by side."""
        for dataset in table.datasets():
            categories = table.categories(dataset)
            series = errors_of(table, dataset)
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
            print_hint(output, table, dataset)
            print_cleanliness_of(output, table, dataset, categories)
        output.note(NOTE)


@dataclass(frozen=True, kw_only=True)
class PartialCommand(MeasuredCommand):
    """Shapes cut by a random plane: UCD at each share hidden (the paper's occlusion curves).

    UCD is measured from the points that are seen; `UCD, whole` from all of the true surface to the same result.

    examples:
      kpred evaluate table partial chair.npz table.npz cabinet.npz --limit 100 -o partial.json
      kpred evaluate table partial packs/ --occlusions 0 0.5 --unknown-frame --limit 20
    """

    top_k: Annotated[int, arg(metavar="K")] = 10
    """How many retrieved models are deformed and compared"""
    occlusions: Annotated[tuple[float, ...], arg(metavar="FRACTION [FRACTION ...]")] = (0.0, 0.25, 0.5, 0.75)
    """Shares of the points that are hidden"""
    unknown_frame: Annotated[bool, arg(help_behavior_hint="")] = False
    """Fit every target too where its place, size and yaw must be found"""

    def config(self) -> TableConfig:
        """Return the plan."""
        from kpred.evaluation.tables.make_table import TableConfig

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
        """Return occlusions side by side, a table for each category."""
        for dataset in table.datasets():
            for category in table.categories(dataset):
                print_pivot(
                    output,
                    table,
                    dataset,
                    f"{dataset}, {category}, partial shapes: best of {self.top_k}, {table.header['unit']}",
                    ["distance", "model", "method"],
                    sorted(errors_of(table, dataset), key=lambda one: one.distance),
                    lambda one: (SHORT.get(one.distance, one.distance), one.model, label(one)),
                    lambda one: f"{one.occlusion:.0%} hidden",
                    category,
                )
            print_cleanliness_of(output, table, dataset, table.categories(dataset)[-1:])
        output.note(NOTE)


@dataclass(frozen=True, kw_only=True)
class TopKCommand(MeasuredCommand):
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
        """Return the plan."""
        from kpred.evaluation.tables.make_table import TableConfig

        return TableConfig("topk", self.split, self.limit, self.seed, self.top_k, oracle=self.oracle)

    def show(self, output: Output, table: Table) -> None:
        """Return numbers of candidates side by side, a table for each category."""
        for dataset in table.datasets():
            for category in table.categories(dataset):
                print_pivot(
                    output,
                    table,
                    dataset,
                    f"{dataset}, {category}, whole shapes: CD, {table.header['unit']}, best of the top k",
                    ["model", "method"],
                    errors_of(table, dataset),
                    lambda one: (one.model, label(one).removeprefix("oracle ")),
                    lambda one: "all" if one.top_k is None else f"top {one.top_k}",
                    category,
                )
            print_cleanliness_of(output, table, dataset, table.categories(dataset)[-1:])
        output.note(NOTE)


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
