"""`kpred data`: synthetic furniture, what mesh packs hold, and data sets as they were downloaded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from tyro.conf import Positional, arg

from kpred.cli.command import Command
from kpred.cli.data_infinigen import InfinigenCommand
from kpred.cli.data_rooms import RoomsCommand
from kpred.cli.data_sets import CheckCommand, PrepareCommand
from kpred.cli.output import Output
from kpred.cli.pack_files import check_pack_place, split_counts
from kpred.cli.usage import UsageError


@dataclass(frozen=True, kw_only=True)
class GenerateCommand(Command):
    """Generate furniture of a category, or things that are none, by seed and write them as a mesh pack.

    examples:
      kpred data generate chair -n 2000 -o chair.npz
      kpred data generate table -n 500 --seed 7 --cuboids 0.3 -o table.npz
      kpred data generate cabinet -n 500 --coarse 0.5 -o cabinet.npz
      kpred data generate sofa -n 500 -o sofa.npz
      kpred data generate other -n 1000 -o other.npz
      kpred data generate other --family bicycle -n 80 -o bicycle.npz
    """

    category: Annotated[Positional[str], arg(metavar="CATEGORY")]
    """chair, table, cabinet, sofa, bed, lamp, toilet, ... (a wrong one lists all); other: no chair, table or cabinet"""
    output: Annotated[Path, arg(aliases=["-o"], metavar="FILE")]
    """The pack to write (.npz)"""
    count: Annotated[int, arg(aliases=["-n"], metavar="N")] = 1000
    """How many shapes"""
    seed: Annotated[int, arg(metavar="SEED")] = 0
    """Shape i depends on category, seed and i alone"""
    cuboids: Annotated[float, arg(metavar="FRACTION")] = 0.0
    """Fraction of shapes, 0 to 1, whose parts are replaced by their boxes"""
    coarse: Annotated[float, arg(metavar="FRACTION")] = 0.0
    """Fraction of shapes, 0 to 1, of few plain boxes in wide proportions, as games and simplified models have them"""
    family: Annotated[str | None, arg(metavar="NAME")] = None
    """Shapes of this family alone, which is then the pack's category (a wrong one lists all)"""
    splits: Annotated[bool, arg(help_behavior_hint="")] = True
    """Put all shapes in the split `source`, and not 15 % source, 70 % train, 15 % val"""

    def run(self, output: Output) -> None:
        """Generate, write, print the numbers."""
        from kpred.synthetic.generator import generate

        check_pack_place(self.output, "mesh")
        pack = generate(
            self.category,
            self.count,
            self.seed,
            cuboids=self.cuboids,
            splits=self.splits,
            coarse=self.coarse,
            family=self.family,
        )
        pack.save(self.output)
        _print_packs(output, [(self.output, pack)])


@dataclass(frozen=True, kw_only=True)
class InfoCommand(Command):
    """Say what mesh packs hold: shapes of each split, triangles, sizes.

    examples:
      kpred data info chair.npz table.npz
      kpred data info chair.npz --json
    """

    packs: Annotated[Positional[tuple[Path, ...]], arg(metavar="PACK [PACK ...]", help_behavior_hint="")]
    """Mesh packs (.npz)"""

    def run(self, output: Output) -> None:
        """Read the packs, print a table."""
        from kpred.shapes import MeshPack

        if not self.packs:
            raise UsageError("no pack was named; try `kpred data info FILE.npz`")
        _print_packs(output, [(path, MeshPack.load(path)) for path in self.packs])


def _print_packs(output: Output, packs: Sequence[tuple[Path, Any]]) -> None:
    import numpy as np

    facts = [
        {
            "path": path,
            "category": pack.category,
            "shapes": len(pack),
            "splits": split_counts(pack),
            "median_faces": float(np.median(np.diff(pack.face_offsets))) if len(pack) else 0.0,
            "parts": 0 if pack.part_names is None else len(pack.part_names),
        }
        for path, pack in packs
    ]
    output.result(facts)
    output.table(
        "mesh packs",
        ["file", "category", "shapes", "splits", "median faces", "part names"],
        [(f["path"], f["category"], f["shapes"], _splits(f["splits"]), f["median_faces"], f["parts"]) for f in facts],
    )


def _splits(counts: Any) -> str:
    return ", ".join(f"{name} {count}" for name, count in counts.items())


COMMAND: dict[str, type[Command]] = {
    "generate": GenerateCommand,
    "info": InfoCommand,
    "check": CheckCommand,
    "prepare": PrepareCommand,
    "infinigen": InfinigenCommand,
    "rooms": RoomsCommand,
}
