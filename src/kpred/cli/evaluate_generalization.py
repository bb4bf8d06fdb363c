"""`kpred evaluate table generalization`: categories seen and held out, random templates, other sources."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import arg

from kpred.cli.table_options import PackTableCommand

if TYPE_CHECKING:
    from kpred.cli.progress import ProgressBar
    from kpred.evaluation.tables.table import Table


@dataclass(frozen=True, kw_only=True)
class GeneralizationCommand(PackTableCommand):
    """How far networks carry: retrieved against random templates, categories seen and held out, other sources.

    Targets are shapes of packs, or models of databases (FILE.kpred in place of a pack), in their known frame, fitted
    with models of their category: of --database, else of the pack's split `source`, else with the other models of
    their own database. Each is fitted with the retrieved models and with ones drawn at random.

    examples:
      kpred evaluate table generalization packs/ -o general.json
      kpred evaluate table generalization furniture-human.kpred --held-out lounger workbench shower --limit 5
      kpred evaluate table generalization furniture-human.kpred --database generated.kpred
    """

    model: Annotated[Path | None, arg(metavar="DIR")] = None
    """Folder of trained networks; without it, the bundled ones"""
    database: Annotated[Path | None, arg(metavar="FILE")] = None
    """Database (.kpred) whose models are the templates"""
    cache: Annotated[Path | None, arg(metavar="FOLDER")] = None
    """Keep the databases that are built in this folder, for the next table"""
    top_k: Annotated[tuple[int, ...], arg(metavar="K [K ...]")] = (1, 10)
    """Numbers of models that are deformed and compared"""
    templates: Annotated[int, arg(metavar="N")] = 50
    """At most so many models of a category are searched, drawn at random by the seed; 0: all of them"""
    held_out: Annotated[tuple[str, ...], arg(metavar="CATEGORY [CATEGORY ...]")] = ()
    """Categories that the networks were not trained on, summed up beside the others"""

    def measure(self, bar: ProgressBar) -> Table:
        """See `TableCommand`."""
        from kpred.evaluation.tables.generalization import GeneralizationConfig, generalization_table

        config = GeneralizationConfig(
            self.split, self.limit, self.seed, self.top_k, self.templates or None, self.held_out
        )
        return generalization_table(
            self.packs, self.model, self.database, config, cache=self.cache, progress=bar.update
        )
