"""`kpred data infinigen`: furniture of Infinigen's factories as a mesh pack."""

from __future__ import annotations

import sys
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from kpred.cli.command import Command
from kpred.cli.output import Output
from kpred.cli.pack_files import check_pack_place, split_counts
from kpred.cli.stopping import resumable


@dataclass(frozen=True, kw_only=True)
class InfinigenCommand(Command):
    """Make furniture with Infinigen's factories, without a window, and write it as a mesh pack.

    Infinigen and Blender live in an environment of their own, whose Python --python names (docs/datasets.md says how
    to make it). Shapes are kept one by one beside the pack (FILE.shapes): a run that was stopped goes on.

    examples:
      kpred data infinigen chair -n 100 -o chair.npz --python infinigen/bin/python
      kpred data infinigen toilet -n 60 --max-faces 1500 -o toilet.npz --python infinigen/bin/python
      kpred data infinigen cabinet -n 950 --workers 2 -o cabinet.npz --python infinigen/bin/python
    """

    category: Annotated[Positional[str], arg(metavar="CATEGORY")]
    """chair, table, cabinet, sofa, bed, lamp, toilet, ... (a wrong one lists all)"""
    output: Annotated[Path, arg(aliases=["-o"], metavar="FILE")]
    """The pack to write (.npz)"""
    count: Annotated[int, arg(aliases=["-n"], metavar="N")] = 100
    """How many shapes"""
    seed: Annotated[int, arg(metavar="SEED")] = 0
    """Factory and seed of shape i depend on category, seed and i alone"""
    python: Annotated[Path, arg(metavar="FILE")] = Path(sys.executable)
    """Python that has infinigen; without it, the one that runs kpred"""
    workers: Annotated[int, arg(metavar="N")] = 1
    """Processes, each with a Blender of its own (2 GB)"""
    max_faces: Annotated[int, arg(metavar="N")] = 3000
    """Triangles that a shape is reduced to"""

    def run(self, output: Output) -> None:
        """Make with a progress bar, write, print the numbers."""
        from kpred.cli.progress import ProgressBar
        from kpred.datasets.infinigen import generate_infinigen

        check_pack_place(self.output, "mesh")
        folder = self.output.with_name(f"{self.output.name}.shapes")
        with resumable(f"{folder} keeps what was made, and the same command goes on"), ProgressBar() as bar:
            done = generate_infinigen(
                self.category, self.count, folder, self.seed, self.python, self.workers, self.max_faces, bar.update
            )
        done.pack.save(self.output)
        output.result(
            {
                "path": self.output,
                "category": self.category,
                "shapes": len(done.pack),
                "splits": split_counts(done.pack),
                "made": done.made,
                "kept": done.kept,
                "failed": [vars(issue) for issue in done.failed],
            }
        )
        counts = Counter(done.pack.extra["factory"].tolist())
        output.table(f"{self.output}: {self.category}", ["factory", "shapes"], sorted(counts.items()))
        output.note(f"{done.made} shapes made, {done.kept} kept from before, {len(done.failed)} failed")
        for issue in done.failed[:10]:
            output.note(f"failed: {issue.name}: {issue.why}")
