"""`kpred plot`: figures of tables, tokens, keypoints, influence and results, as PNG or PDF."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, arg

from kpred.cli.command import Command, Group
from kpred.cli.output import Output
from kpred.cli.table_options import ModelOptions
from kpred.cli.usage import UsageError

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, kw_only=True)
class _PlotCommand(Command):
    """What all figures share."""

    output: Annotated[Path, arg(aliases=["-o"], metavar="FILE")]
    """The figure, .png or .pdf"""
    seed: Annotated[int, arg(metavar="SEED")] = 0
    """Of everything that is drawn by chance; the same arguments give the same figure"""

    @abstractmethod
    def draw(self) -> Figure:
        """Draw the figure."""

    def run(self, output: Output) -> None:
        """Draw and write."""
        from kpred.evaluation.plots.figure import check_figure, save_figure

        check_figure(self.output)
        save_figure(self.draw(), self.output)
        output.result({"figure": self.output, "command": output.command})
        output.note(f"wrote {self.output}")


@dataclass(frozen=True, kw_only=True)
class OcclusionCommand(_PlotCommand):
    """Occlusion curves: UCD against the fraction hidden, with 95 % bands, of tables of `kpred evaluate table partial`.

    examples:
      kpred plot occlusion partial.json -o occlusion.png
      kpred plot occlusion partial.json --methods refined no_learning --whole -o whole.pdf
    """

    tables: Annotated[Positional[tuple[Path, ...]], arg(metavar="TABLE.json [...]", help_behavior_hint="")]
    """Files that -o of `kpred evaluate table partial` (or ablation) wrote"""
    methods: Annotated[tuple[str, ...], arg(metavar="METHOD [METHOD ...]")] = ("no_learning", "feed_forward", "refined")
    """Which curves, by their names in the table"""
    whole: Annotated[bool, arg(help_behavior_hint="")] = False
    """Measured from the whole surface, not only from what is seen"""

    def draw(self) -> Figure:
        """Draw the figure."""
        from kpred.evaluation.plots.occlusion import occlusion_figure
        from kpred.evaluation.tables.table import read_table

        if not self.tables:
            raise UsageError("no table was named; try `kpred plot occlusion TABLE.json -o FILE.png`")
        return occlusion_figure([read_table(file) for file in self.tables], self.methods, self.whole)


@dataclass(frozen=True, kw_only=True)
class _DatabasePlotCommand(_PlotCommand):
    """Figures of the models of one category of a database."""

    category: Annotated[str, arg(metavar="NAME")] = "chair"
    """Which category"""
    database: Annotated[Path | None, arg(metavar="FILE")] = None
    """CAD database (.kpred); without it, the bundled one"""


@dataclass(frozen=True, kw_only=True)
class TokensCommand(_DatabasePlotCommand):
    """Map of the retrieval tokens of a category (t-SNE of their distance), with pictures of some models.

    examples:
      kpred plot tokens -o tokens.png
      kpred plot tokens --database mine.kpred --category sofa --pictures 60 -o tokens.pdf
    """

    pictures: Annotated[int, arg(metavar="N")] = 60
    """At most so many models are shown as pictures"""
    max_models: Annotated[int, arg(metavar="N")] = 600
    """At most so many models, drawn by the seed"""

    def draw(self) -> Figure:
        """Draw the figure."""
        from kpred.evaluation.plots.tokens import tokens_figure
        from kpred.fitting.defaults import resolve_database

        if self.max_models < 1 or self.pictures < 0:
            raise UsageError("--max-models must be at least 1, and --pictures not negative")
        return tokens_figure(
            resolve_database(self.database), self.category, self.pictures, self.max_models, seed=self.seed
        )


@dataclass(frozen=True, kw_only=True)
class KeypointsCommand(_DatabasePlotCommand):
    """Keypoints of models of one category: the same colour is the same keypoint.

    examples:
      kpred plot keypoints --category table -o keypoints.png
    """

    count: Annotated[int, arg(metavar="N")] = 12
    """How many models, drawn by the seed"""

    def draw(self) -> Figure:
        """Draw the figure."""
        from kpred.evaluation.plots.keypoints import keypoints_figure
        from kpred.fitting.defaults import resolve_database

        return keypoints_figure(resolve_database(self.database), self.category, self.count, seed=self.seed)


@dataclass(frozen=True, kw_only=True)
class InfluenceCommand(_DatabasePlotCommand):
    """What moving one keypoint moves: vertices of the cage, and points of the shape.

    examples:
      kpred plot influence --category chair --keypoints 0 3 7 -o influence.png
    """

    model: Annotated[str | None, arg(metavar="NAME_OR_PATH")] = None
    """Trained networks that made the database; without it, the bundled ones"""
    keypoints: Annotated[tuple[int, ...], arg(metavar="N [N ...]")] = (0, 3, 6, 9)
    """Numbers of keypoints, from 0"""
    count: Annotated[int, arg(metavar="N")] = 2
    """How many models, drawn by the seed"""

    def draw(self) -> Figure:
        """Draw the figure."""
        from kpred.evaluation.plots.keypoints import influence_figure
        from kpred.fitting.defaults import resolve_database, resolve_model

        network = resolve_model(self.model)[self.category]
        return influence_figure(resolve_database(self.database), network, self.keypoints, self.count, self.seed)


@dataclass(frozen=True, kw_only=True)
class GridCommand(_PlotCommand, ModelOptions):
    """Targets beside what was retrieved and what was made of it, with errors; known frame.

    examples:
      kpred plot grid chair.npz table.npz --count 4 -o grid.png
      kpred plot grid chair.npz --occlusion 0.5 --model kp-red=runs/kp-red --model kp-red-plus=bundled -o grid.pdf
    """

    packs: Annotated[Positional[tuple[Path, ...]], arg(metavar="PACK [PACK ...]", help_behavior_hint="")]
    """Mesh packs (.npz), or folders of them"""
    split: Annotated[str, arg(metavar="NAME")] = "val"
    """Whose shapes are the targets"""
    count: Annotated[int, arg(metavar="N")] = 6
    """How many targets of each pack, drawn by the seed"""
    occlusion: Annotated[float, arg(metavar="FRACTION")] = 0.0
    """Fraction of each target that a plane hides"""
    top_k: Annotated[int, arg(metavar="K")] = 10
    """How many retrieved models are deformed and compared"""

    def draw(self) -> Figure:
        """Draw the figure."""
        from kpred.cli.progress import ProgressBar
        from kpred.evaluation.plots.grid import GridConfig, grid_figure

        if not self.packs:
            raise UsageError("no pack was named; try `kpred plot grid FILE.npz -o FILE.png`")
        if not 0 <= self.occlusion <= 0.95:
            raise UsageError(f"--occlusion must be a fraction from 0 to 0.95, but is {self.occlusion:g}")
        config = GridConfig(self.split, self.count, self.seed, self.occlusion, self.top_k)
        with ProgressBar() as bar:
            return grid_figure(
                self.packs,
                self.named_models(),
                config,
                self.named_databases(),
                cache=self.cache,
                progress=bar.update,
            )


@dataclass(frozen=True, kw_only=True)
class CatalogueCommand(_DatabasePlotCommand):
    """Sheet of a category's models: a picture of each, with its id, size, author and licence.

    All are seen from the front, the right and above; a model that does not stand like the others has a wrong front or
    up axis in its manifest.

    examples:
      kpred plot catalogue --database furniture.kpred --category chair -o chairs.png
    """

    max_models: Annotated[int, arg(metavar="N")] = 200
    """At most so many models, drawn by the seed"""

    def draw(self) -> Figure:
        """Draw the figure."""
        from kpred.evaluation.plots.catalogue import catalogue_figure
        from kpred.fitting.defaults import resolve_database

        if self.max_models < 1:
            raise UsageError(f"--max-models must be at least 1, but is {self.max_models}")
        return catalogue_figure(resolve_database(self.database), self.category, self.max_models, self.seed)


COMMAND = Group(
    {
        "occlusion": OcclusionCommand,
        "tokens": TokensCommand,
        "keypoints": KeypointsCommand,
        "influence": InfluenceCommand,
        "grid": GridCommand,
        "catalogue": CatalogueCommand,
    }
)
