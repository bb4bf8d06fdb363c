"""`kpred evaluate table scan2cad`: the annotated objects of real scenes."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, arg

from kpred.cli.evaluate_cleanliness import print_cleanliness_of
from kpred.cli.output import Output
from kpred.cli.table_options import NOTE, SHORT, ModelOptions, TableCommand, errors_of, label, shown

if TYPE_CHECKING:
    from kpred.evaluation.tables.table import Table


@dataclass(frozen=True, kw_only=True)
class Scan2CadCommand(TableCommand, ModelOptions):
    """Objects of Scan2CAD scenes: UCD in the annotated CAD model's frame (the paper), and where it must be found.

    FOLDER is laid out as Scan2CAD's repository: full_annotations.json, Assets/scannet-sample, Assets/shapenet-sample;
    or <scene>/ and <synset>/ in the folder itself. Scenes, models and objects that are not there are counted and told.
    `annotated cad` is the model that people chose, as they placed it.

    examples:
      kpred evaluate table scan2cad Scan2CAD/ -o scan2cad.json
      kpred evaluate table scan2cad Scan2CAD/ --source chair.npz table.npz cabinet.npz --model kp-red=runs/kp-red
    """

    packs: Annotated[Positional[tuple[Path, ...]], arg(metavar="FOLDER [FOLDER ...]", help_behavior_hint="")]
    """Folders laid out as Scan2CAD's repository"""
    source: Annotated[tuple[Path, ...], arg(metavar="PACK [PACK ...]", help_behavior_hint="")] = ()
    """Packs whose split `source` is searched; without them, the bundled database"""
    top_k: Annotated[int, arg(metavar="K")] = 10
    """How many retrieved models are deformed and compared"""

    def run(self, output: Output) -> None:
        """Measure with a progress bar, print and write."""
        from kpred.cli.progress import ProgressBar
        from kpred.evaluation.tables.make_table import TableConfig
        from kpred.evaluation.tables.scan2cad_table import make_scan2cad_table

        self.check()
        models, databases = self.named_models(), self.named_databases()
        config = TableConfig("scan2cad", seed=self.seed, top_k=(self.top_k,), unknown_frame=True)
        began = time.perf_counter()
        with ProgressBar() as bar:
            table = make_scan2cad_table(
                self.packs, models, config, databases, self.source, cache=self.cache, progress=bar.update
            )
        self.finish(output, table, time.perf_counter() - began, self.show)

    def show(self, output: Output, table: Table) -> None:
        """Return categories side by side."""
        for dataset in table.datasets():
            categories = table.categories(dataset)
            count = {name: sum(name in (s.category, "all") for s in table.subjects()) for name in categories}
            output.table(
                f"{dataset}, real scans: UCD, best of {self.top_k}, {table.header['unit']}; frame of the annotated CAD "
                "model, known unless told",
                ["distance", "model", "method", *(f"{name} ({count[name]})" for name in categories)],
                [
                    [
                        SHORT.get(one.distance, one.distance),
                        one.model,
                        label(one),
                        *(shown(table.cell(one, dataset, name)) for name in categories),
                    ]
                    for one in sorted(errors_of(table, dataset), key=lambda one: one.distance)
                ],
            )
            print_cleanliness_of(output, table, dataset, categories[-1:])
        output.note(NOTE)
