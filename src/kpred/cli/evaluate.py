"""`kpred evaluate`: the group; and `shapes`, how well a model fits, beside what needs no model."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional, arg

from kpred.cli.command import Command, Group
from kpred.cli.evaluate_catalogue import CatalogueCommand
from kpred.cli.evaluate_cleanliness import COLUMNS, print_cleanliness
from kpred.cli.evaluate_compare import CompareCommand
from kpred.cli.evaluate_peers import PeersCommand
from kpred.cli.evaluate_real import RealCommand
from kpred.cli.evaluate_scans import ScansCommand
from kpred.cli.evaluate_table import TABLES
from kpred.cli.output import Output
from kpred.cli.usage import UsageError


@dataclass(frozen=True, kw_only=True)
class ShapesCommand(Command):
    """Measure a model on whole shapes of mesh packs: best of the top k, mean over a split.

    The same run measures the true nearest undeformed shapes and a baseline without learning, and how clean the deformed
    meshes are. Without --database, the
    split `source` of each pack is what is retrieved and deformed. With --json or -o: a header (weights, database, seed,
    versions), and one row a number, with dataset, split, category, protocol, top_k, metric, distance, unit, value, n.

    examples:
      kpred evaluate shapes chair.npz table.npz cabinet.npz
      kpred evaluate shapes packs/ --model runs/chair/model --top-k 1 5 10 25 -o rows.json
      kpred evaluate shapes chair.npz --protocol partial --occlusions 0.25 0.5 --limit 50 --json
    """

    packs: Annotated[Positional[tuple[Path, ...]], arg(metavar="PACK [PACK ...]", help_behavior_hint="")]
    """Mesh packs (.npz), or folders of them"""
    output: Annotated[Path | None, arg(aliases=["-o"], metavar="FILE")] = None
    """Write the rows, and what they were made by, to this JSON file too"""
    model: Annotated[str | None, arg(metavar="NAME_OR_PATH")] = None
    """Trained networks: a name or a folder; without it, the bundled ones"""
    database: Annotated[Path | None, arg(metavar="FILE")] = None
    """Search this database (.kpred); without it, one built from the split `source` of each pack"""
    split: Annotated[str, arg(metavar="NAME")] = "val"
    """Whose shapes are the targets"""
    top_k: Annotated[tuple[int, ...], arg(metavar="K [K ...]")] = (10,)
    """How many retrieved models are deformed and compared; several numbers are measured in one run"""
    protocol: Literal["full", "partial", "all"] = "full"
    """Whole clouds, clouds cut by a random plane, or both; always in the frame of the whole shape"""
    occlusions: Annotated[tuple[float, ...], arg(metavar="FRACTION [FRACTION ...]")] = (0.0, 0.25, 0.5, 0.75)
    """Shares hidden in the partial protocol"""
    limit: Annotated[int | None, arg(metavar="N")] = None
    """At most so many targets a pack, drawn at random by the seed"""
    seed: Annotated[int, arg(metavar="SEED")] = 0
    """Of targets, planes and sampling; the same arguments give the same rows"""
    oracle: Annotated[bool, arg(help_behavior_hint="")] = False
    """Deform and compare all of the database as well (slow)"""

    def run(self, output: Output) -> None:
        """Measure with a progress bar, print and write the rows."""
        from kpred.atomic import check_place
        from kpred.cli.progress import ProgressBar
        from kpred.evaluation import evaluate, run_header, write_rows
        from kpred.evaluation.tables.rows import UNIT
        from kpred.nn import load_model

        if not self.packs:
            raise UsageError("no pack was named; try `kpred evaluate shapes FILE.npz`")
        if self.output is not None:
            check_place(self.output)
        model = load_model(self.model)
        left_out: list[str] = []
        with ProgressBar() as bar:
            rows = evaluate(
                self.packs,
                model,
                self.database,
                split=self.split,
                top_k=self.top_k,
                protocol=self.protocol,
                occlusions=self.occlusions,
                limit=self.limit,
                seed=self.seed,
                oracle=self.oracle,
                progress=bar.update,
                report=left_out.append,
            )
        header = run_header(
            model,
            self.database,
            split=self.split,
            top_k=self.top_k,
            protocol=self.protocol,
            occlusions=self.occlusions,
            limit=self.limit,
            seed=self.seed,
            remarks=left_out,
        )
        if self.output is not None:
            write_rows(self.output, header, rows)
        output.result({"header": header, "rows": [row.to_json() for row in rows]})
        for dataset, category in dict.fromkeys((row.dataset, row.category) for row in rows):
            mine = [row for row in rows if (row.dataset, row.category) == (dataset, category)]
            shown = [row for row in mine if row.unit == UNIT]
            first = shown[0]
            output.table(
                f"{dataset} / {category}: {first.n} shapes of {first.split} against {first.database_models} models; "
                f"{first.unit}, {first.frame}",
                ["protocol", "metric", "distance", "top k", "value", "/ undeformed", "/ unlearned"],
                [
                    (
                        row.protocol if row.protocol == "full" else f"{row.protocol} {row.occlusion:g}",
                        row.metric.replace("_", " "),
                        _SHORT.get(row.distance, row.distance),
                        "all" if row.top_k is None else str(row.top_k),
                        row.value,
                        row.ratio_to_undeformed,
                        row.ratio_to_no_learning,
                    )
                    for row in shown
                ],
            )
            clean: dict[tuple[str, ...], dict[str, tuple[float, float]]] = {}
            for row in mine:
                if row.distance in COLUMNS:
                    protocol = row.protocol if row.protocol == "full" else f"{row.protocol} {row.occlusion:g}"
                    found = clean.setdefault((protocol, row.metric.replace("_", " ")), {})
                    found[row.distance] = row.value, row.percentile_95
            print_cleanliness(output, f"{dataset} / {category}", ("protocol", "metric"), list(clean.items()))
        output.note("note: means over the shapes; the numbers of published tables are most likely 10^2 times these")
        for sentence in left_out[:10]:
            output.note(f"note: {sentence}")
        if len(left_out) > 10:
            output.note(f"note: and {len(left_out) - 10} more")
        if self.output is not None:
            output.note(f"wrote {self.output}")


_SHORT = {
    "chamfer_distance": "CD",
    "unilateral_chamfer_distance": "UCD",
    "unilateral_chamfer_distance_of_whole_surface": "UCD, whole",
}


COMMAND = Group(
    {
        "shapes": ShapesCommand,
        "scans": ScansCommand,
        "catalogue": CatalogueCommand,
        "real": RealCommand,
        "table": TABLES,
        "compare": CompareCommand,
        "peers": PeersCommand,
    }
)

IMPLIED = "shapes"
"""Meant by `kpred evaluate PACK`."""
