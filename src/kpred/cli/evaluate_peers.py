"""`kpred evaluate peers`: several methods, this package's and others, on one bench."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Literal

from tyro.conf import UseAppendAction, arg

from kpred.cli.table_options import BUNDLED, PackTableCommand, named

if TYPE_CHECKING:
    from kpred.cli.progress import ProgressBar
    from kpred.evaluation.page import Page
    from kpred.evaluation.tables.table import Table


@dataclass(frozen=True, kw_only=True)
class PeersCommand(PackTableCommand):
    """Measure several methods on the same targets against the same sources: best of the top k, mean over the shapes.

    A method is a folder of weights: of a peer (`kpred train peer`) or of this package's networks (`bundled`, or a
    folder). The nearest undeformed shape and the baseline without learning are measured with them. What is written is a
    table, as of `kpred evaluate table`; a peer's row is `feed_forward`, as the published protocol of the networks.

    examples:
      kpred evaluate peers chair.npz --method kp-red-plus=bundled --method uy2021=runs/uy2021/chair
      kpred evaluate peers packs/ --method keypoint-deformer=runs/keypoint-deformer --limit 50 -o rows.json
    """

    method: UseAppendAction[Annotated[tuple[str, ...], arg(metavar="NAME=FOLDER")]] = ()
    """A method, once for each: its name in the rows, and the folder of its weights (or of folders a category)"""
    refined_peers: Annotated[bool, arg(help_behavior_hint="")] = False
    """Measure KeypointDeformer with this package's keypoint refinement too, which its publication does not have"""
    top_k: Annotated[tuple[int, ...], arg(metavar="K [K ...]")] = (10,)
    """How many retrieved sources are deformed and compared"""
    protocol: Literal["full", "partial"] = "full"
    """Whole clouds, or clouds cut by a random plane (for which no peer was trained); frame of the whole shape"""
    occlusions: Annotated[tuple[float, ...], arg(metavar="FRACTION [FRACTION ...]")] = (0.0, 0.25, 0.5, 0.75)
    """Fractions hidden in the partial protocol"""

    def check(self) -> None:
        """Refuse what cannot work before any work is done."""
        super().check()
        named(self.method, "method")

    def measure(self, bar: ProgressBar) -> Table:
        """Measure all methods."""
        from kpred.evaluation.tables.config import TableConfig
        from kpred.evaluation.tables.make_table import make_table
        from kpred.peers.methods.peers import peer_method
        from kpred.peers.networks.loading import holds_peers

        folders = dict(named(self.method, "method"))
        peers = [name for name, folder in folders.items() if folder != BUNDLED and holds_peers(folder)]
        return make_table(
            self.packs,
            {name: folder for name, folder in folders.items() if name not in peers},
            TableConfig(self.protocol, self.split, self.limit, self.seed, self.top_k, self.occlusions),
            methods=[peer_method(name, folders[name], self.refined_peers) for name in peers],
            progress=bar.update,
            # The header holds what is left out, and `run` prints it.
            report=lambda sentence: None,
        )

    def pages(self, table: Table) -> Iterator[Page]:
        """Lay out values beside their ratios."""
        from kpred.evaluation.tables.pages import ratio_pages

        return ratio_pages(table)
