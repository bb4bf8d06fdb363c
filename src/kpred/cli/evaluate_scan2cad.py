"""`kpred evaluate table scan2cad`: the annotated objects of real scenes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, UseAppendAction, arg

from kpred.cli.table_options import ModelOptions, TableCommand, named
from kpred.cli.usage import UsageError

if TYPE_CHECKING:
    from kpred.cli.progress import ProgressBar
    from kpred.evaluation.tables.table import Table


@dataclass(frozen=True, kw_only=True)
class Scan2CadCommand(TableCommand, ModelOptions):
    """Objects of Scan2CAD scenes: UCD in the annotated CAD model's frame (the paper), and where it must be found.

    FOLDER is laid out as Scan2CAD's repository: full_annotations.json, Assets/scannet-sample, Assets/shapenet-sample;
    or <scene>/ and <synset>/ in the folder itself. Missing scenes, models and objects are counted and listed.
    `annotated cad` is the model that people chose, as they placed it.

    examples:
      kpred evaluate table scan2cad Scan2CAD/ -o scan2cad.json
      kpred evaluate table scan2cad Scan2CAD/ --source chair.npz table.npz cabinet.npz --model kp-red=runs/kp-red
      kpred evaluate table scan2cad Scan2CAD/ --source chair.npz table.npz cabinet.npz --peer u-red=runs/u-red
    """

    packs: Annotated[Positional[tuple[Path, ...]], arg(metavar="FOLDER [FOLDER ...]", help_behavior_hint="")]
    """Folders laid out as Scan2CAD's repository"""
    source: Annotated[tuple[Path, ...], arg(metavar="PACK [PACK ...]", help_behavior_hint="")] = ()
    """Packs whose split `source` is searched; without them, the bundled database"""
    peer: Annotated[UseAppendAction[tuple[str, ...]], arg(metavar="NAME=FOLDER", help_behavior_hint="repeatable")] = ()
    """Weights of a peer (`kpred train peer`) and its name in the table; it searches the packs of --source"""
    top_k: Annotated[int, arg(metavar="K")] = 10
    """How many retrieved models are deformed and compared"""

    def check(self) -> None:
        """Refuse what cannot work before any work is done."""
        super().check()
        if named(self.peer, "peer") and not self.source:
            raise UsageError("--peer searches mesh packs; name them by --source PACK [PACK ...]")

    def measure(self, bar: ProgressBar) -> Table:
        """Measure the objects of all scenes."""
        from kpred.evaluation.tables.config import TableConfig
        from kpred.evaluation.tables.scan2cad_table import make_scan2cad_table
        from kpred.peers.methods.peers import peer_method

        config = TableConfig("scan2cad", seed=self.seed, top_k=(self.top_k,), unknown_frame=True)
        return make_scan2cad_table(
            self.packs,
            self.named_models(),
            config,
            self.named_databases(),
            self.source,
            methods=[peer_method(name, folder) for name, folder in named(self.peer, "peer")],
            cache=self.cache,
            progress=bar.update,
        )
