"""`kpred evaluate table oracle`: how well retrieval ranks, by deforming all of the database to every target."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

from tyro.conf import arg

from kpred.cli.output import Output
from kpred.cli.table_options import NOTE, MeasuredCommand, print_pivot

if TYPE_CHECKING:
    from kpred.evaluation.tables.make_table import TableConfig
    from kpred.evaluation.tables.table import Series, Table


@dataclass(frozen=True, kw_only=True)
class OracleCommand(MeasuredCommand):
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
    occlusions: Annotated[tuple[float, ...], arg(metavar="FRACTION [FRACTION ...]")] = ()
    """Judge shapes cut by a plane too, with these shares hidden"""

    def config(self) -> TableConfig:
        """Return the plan."""
        from kpred.evaluation.tables.make_table import TableConfig

        return TableConfig("oracle", self.split, self.limit, self.seed, self.top_k, self.occlusions)

    def show(self, output: Output, table: Table) -> None:
        """Return orders and numbers of candidates, a table for each category."""
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
