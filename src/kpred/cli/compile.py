"""`kpred compile`: compile what fits need ahead of the first fit."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

from kpred.cli.command import Command
from kpred.cli.output import Output

if TYPE_CHECKING:
    import numpy as np


@dataclass(frozen=True, kw_only=True)
class CompileCommand(Command):
    """Compile the code of a fit and cache it on disk, so that the first fit takes seconds.

    `make install` runs it. Code that is cached already is not compiled again.

    examples:
      kpred compile
      kpred compile --json
    """

    def run(self, output: Output) -> None:
        """Fit the sample scan in several ways, and print where the compiled code is."""
        from kpred.cli.compilation import cache_folder
        from kpred.fitting import sample_scan
        from kpred.shapes import read_scan

        output.note("compiling what is not cached yet (about a minute of processor time, once for this installation)")
        start = time.perf_counter()
        fit_in_all_ways(read_scan(sample_scan()))
        seconds, folder = time.perf_counter() - start, str(cache_folder())
        output.note(f"compiled code is cached, for example in {folder} ({seconds:.0f} s)")
        output.result({"seconds": seconds, "folder": folder})


def fit_in_all_ways(scan: np.ndarray) -> None:
    """Run the compiled code of `kpred fit`: fit a scan (N, 3), y up, as unknown, as partial and as known."""
    import numpy as np

    from kpred.fitting.pipeline import fit

    low, high = scan.min(axis=0), scan.max(axis=0)
    center, half = (low + high) / 2, (high - low).max() / 2
    fit(scan)
    fit(scan, partial=True, up="y", sensor=center + np.array([1.0, 1.0, 3.0]) * half)
    fit((scan - center) / half, frame="known", deform="free")
    fit((scan - center) / half, frame="known", deform="paper")
    # A mesh is moved in double precision, where its structure changes.
    fit((scan - center) / half, frame="known", deform="structure")


COMMAND: type[Command] = CompileCommand
