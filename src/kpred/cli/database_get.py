"""`kpred database get`: a database of a catalogue that others publish, made here by one command."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Literal

from tyro.conf import Positional, arg

from kpred.cli.database_build import EncodingCommand
from kpred.cli.output import Output


@dataclass(frozen=True, kw_only=True)
class GetCommand(EncodingCommand):
    """Make a database of human-made furniture and fixtures of Sweet Home 3D, in over 30 categories.

    The category of a scan is found for 25 of them; others, such as loungers, are searched by `kpred fit --category`.

    The models come from Debian's package sweethome3d-furniture: the installed one, the file that --source names, or
    what apt downloads. They are under CC0 and CC BY 3.0; authors and licences are kept with each model, and stand in
    every result. Models whose licence does not let them be passed on are left out.

    examples:
      kpred database get furniture
      kpred database get furniture --source sweethome3d-furniture_1.8-1_all.deb -o furniture.kpred
      kpred database get furniture --catalogue furniture/
    """

    name: Annotated[Positional[Literal["furniture"]], arg(metavar="NAME")]
    """Which catalogue: furniture"""
    output: Annotated[str, arg(aliases=["-o"], metavar="FILE")] = "furniture-human.kpred"
    """The database to write: a file (.kpred) or postgresql://user@host/name"""
    source: Annotated[Path | None, arg(metavar="PATH")] = None
    """Package (.deb), library (.sh3f) or folder of libraries"""
    catalogue: Annotated[Path | None, arg(metavar="FOLDER")] = None
    """Keep the meshes, materials and manifest in this folder"""

    def run(self, output: Output) -> None:
        """Unpack, write the catalogue, and build."""
        from kpred.datasets.sweethome3d.catalogue import make_catalogue
        from kpred.datasets.sweethome3d.categories import FURNITURE
        from kpred.datasets.sweethome3d.package import find_libraries
        from kpred.nn import load_model

        model = load_model(self.model)

        with TemporaryDirectory(prefix="kpred-") as scratch:
            folder = Path(scratch, "catalogue") if self.catalogue is None else self.catalogue
            libraries = find_libraries(self.source, Path(scratch, "package"))
            report = make_catalogue(libraries, folder, [name for name in FURNITURE if name in model])
            for one in report.left_out:
                output.note(f"left out: {one.key}: {one.reason}")
            licences = ", ".join(f"{count} {name}" for name, count in report.licences.items())
            output.note(f"catalogue: {sum(report.counts.values())} models ({licences})")
            self.encode(output, folder, self.output, resume=True)
