"""`kpred data rooms`: furnished virtual rooms, scanned as real ones are."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import arg

from kpred.cli.command import Command
from kpred.cli.output import Output
from kpred.cli.pack_files import check_pack_place


@dataclass(frozen=True, kw_only=True)
class RoomsCommand(Command):
    """Furnish and scan virtual rooms by seed and write them as a room pack.

    Rooms hold furniture of the generator and of the given mesh packs, other things, walls with doors and windows, and
    clutter; a depth sensor scans them by hand, from tripods, in one view, or a LiDAR does. docs/rooms.md describes the
    file. Room i depends on seed, i and the packs alone.

    examples:
      kpred data rooms -n 300 -o rooms.npz
      kpred data rooms -n 300 --first 300 --packs infinigen/*.npz --points 30000 -o more_rooms.npz
      kpred data rooms -n 20 --seed 9 --scanner view --splits val --packs infinigen/*.npz -o views.npz
    """

    output: Annotated[Path, arg(aliases=["-o"], metavar="FILE")]
    """The room pack to write (.npz)"""
    count: Annotated[int, arg(aliases=["-n"], metavar="N")] = 100
    """How many rooms"""
    seed: Annotated[int, arg(metavar="SEED")] = 0
    """Room i depends on seed, i and the packs alone"""
    first: Annotated[int, arg(metavar="I")] = 0
    """Index of the first room"""
    packs: Annotated[tuple[Path, ...], arg(metavar="PACK [PACK ...]")] = ()
    """Mesh packs (.npz, metres) whose shapes furnish the rooms, beside the generator's"""
    splits: Annotated[tuple[str, ...], arg(metavar="NAME [NAME ...]")] = ("source", "train")
    """Splits of these packs that are used"""
    scanner: Annotated[Literal["mixed", "mesh", "dense", "view", "lidar"], arg(metavar="NAME")] = "mixed"
    """mesh (a hand-held camera, fused), dense (tripods), view (one depth image), lidar, or mixed"""
    points: Annotated[int | None, arg(metavar="N")] = None
    """Most points of a room; without it, what the scanner gives (40,000 to 220,000)"""

    def run(self, output: Output) -> None:
        """Generate with a progress bar, write, print the numbers."""
        from kpred.cli.progress import ProgressBar
        from kpred.shapes.pack import MeshPack
        from kpred.synthetic.rooms.generate import generate_rooms

        check_pack_place(self.output, "room")
        packs = [MeshPack.load(path) for path in self.packs]
        scanner = None if self.scanner == "mixed" else self.scanner
        with ProgressBar() as bar:
            rooms = generate_rooms(
                self.count, self.seed, packs, self.first, scanner, self.points, self.splits, bar.update
            )
        rooms.save(self.output)
        objects = dict(sorted(Counter(rooms.category.tolist()).items()))
        facts = {
            "path": self.output,
            "rooms": len(rooms),
            "points": len(rooms.points),
            "scanners": dict(sorted(Counter(rooms.scanner.tolist()).items())),
            "objects": objects,
        }
        output.result(facts)
        output.table(
            f"{self.output}: {len(rooms)} rooms, {len(rooms.points)} points",
            ["category", "objects"],
            list(objects.items()),
        )
