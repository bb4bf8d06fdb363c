"""`kpred evaluate`: the group; and `shapes`, how well a model fits, beside what needs no model."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Literal

from tyro.conf import arg

from kpred.cli.command import Group
from kpred.cli.evaluate_catalogue import CatalogueCommand
from kpred.cli.evaluate_compare import CompareCommand
from kpred.cli.evaluate_peers import PeersCommand
from kpred.cli.evaluate_real import RealCommand
from kpred.cli.evaluate_rooms import RoomsCommand
from kpred.cli.evaluate_scans import ScansCommand
from kpred.cli.evaluate_table import TABLES
from kpred.cli.table_options import MeasuredCommand

if TYPE_CHECKING:
    from kpred.evaluation.page import Page
    from kpred.evaluation.tables.config import TableConfig
    from kpred.evaluation.tables.table import Table


@dataclass(frozen=True, kw_only=True)
class ShapesCommand(MeasuredCommand):
    """Measure models on whole shapes of mesh packs: best of the top k, mean over a split.

    The same run measures the true nearest undeformed shapes and a baseline without learning, and how clean the deformed
    meshes are. Without --database, the split `source` of each pack is what is retrieved and deformed. What is written
    is a table, as of `kpred evaluate table`; what is printed has one row a number, beside its ratios to both baselines.

    examples:
      kpred evaluate shapes chair.npz table.npz cabinet.npz
      kpred evaluate shapes packs/ --model runs/chair/model --top-k 1 5 10 25 -o rows.json
      kpred evaluate shapes chair.npz --protocol partial --occlusions 0.25 0.5 --limit 50 --json
    """

    top_k: Annotated[tuple[int, ...], arg(metavar="K [K ...]")] = (10,)
    """How many retrieved models are deformed and compared; several numbers are measured in one run"""
    protocol: Literal["full", "partial", "all"] = "full"
    """Whole clouds, clouds cut by a random plane, or both; always in the frame of the whole shape"""
    occlusions: Annotated[tuple[float, ...], arg(metavar="FRACTION [FRACTION ...]")] = (0.0, 0.25, 0.5, 0.75)
    """Fractions hidden in the partial protocol"""
    oracle: Annotated[bool, arg(help_behavior_hint="")] = False
    """Deform and compare all of the database as well (slow)"""

    def config(self) -> TableConfig:
        """Return the settings of the table."""
        from kpred.evaluation.tables.config import TableConfig

        return TableConfig(
            self.protocol, self.split, self.limit, self.seed, self.top_k, self.occlusions, oracle=self.oracle
        )

    def pages(self, table: Table) -> Iterator[Page]:
        """Lay out values beside their ratios."""
        from kpred.evaluation.tables.pages import ratio_pages

        return ratio_pages(table)


COMMAND = Group(
    {
        "shapes": ShapesCommand,
        "scans": ScansCommand,
        "catalogue": CatalogueCommand,
        "real": RealCommand,
        "rooms": RoomsCommand,
        "table": TABLES,
        "compare": CompareCommand,
        "peers": PeersCommand,
    }
)

IMPLIED = "shapes"
"""Meant by `kpred evaluate PACK`."""
