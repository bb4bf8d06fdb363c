"""Options that the commands of tables share: packs, models and their names, targets, output."""

from __future__ import annotations

import time
from abc import abstractmethod
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar

from tyro.conf import Positional, UseAppendAction, arg

from kpred.cli.command import Command
from kpred.cli.output import Output
from kpred.cli.usage import UsageError

if TYPE_CHECKING:
    from kpred.cli.progress import ProgressBar
    from kpred.evaluation.page import Page
    from kpred.evaluation.tables.config import TableConfig
    from kpred.evaluation.tables.table import Table

BUNDLED = "bundled"


@dataclass(frozen=True, kw_only=True)
class TableCommand(Command):
    """What all tables share."""

    packs: Annotated[Positional[tuple[Path, ...]], arg(metavar="PACK [PACK ...]", help_behavior_hint="")]
    """Mesh packs (.npz), or folders of them; a data set is named after its folder"""
    output: Annotated[Path | None, arg(aliases=["-o"], metavar="FILE")] = None
    """Write FILE.json (all), FILE.csv (the table) and FILE.targets.csv (target by target)"""
    seed: Annotated[int, arg(metavar="SEED")] = 0
    """Of targets, planes, sampling and intervals; the same arguments give the same values"""

    def check(self) -> None:
        """Refuse what cannot work before any work is done."""
        from kpred.evaluation.tables.table import table_files

        if not self.packs:
            raise UsageError("no pack was named; try `kpred evaluate table full FILE.npz`")
        if self.output is not None:
            table_files(self.output)

    @abstractmethod
    def measure(self, bar: ProgressBar) -> Table:
        """Make the table."""

    def pages(self, table: Table) -> Iterator[Page]:
        """Lay out the table."""
        from kpred.evaluation.tables.pages import pages

        return pages(table)

    def run(self, output: Output) -> None:
        """Measure with a progress bar, write, print, and list what was left out."""
        from kpred.cli.progress import ProgressBar
        from kpred.evaluation.page import brief
        from kpred.evaluation.tables.pages import NOTE
        from kpred.evaluation.tables.table import write_table

        self.check()
        began = time.perf_counter()
        with ProgressBar() as bar:
            table = self.measure(bar)
        seconds = time.perf_counter() - began
        table.header["command"], table.header["seconds"] = output.command, round(seconds, 1)
        written = write_table(table, self.output) if self.output is not None else ()
        output.result(table.to_json())
        print_pages(output, self.pages(table))
        output.note(NOTE)
        remarks = [str(sentence) for sentence in table.header.get("remarks", [])]
        if remarks:
            output.note(f"note: remarks: {len(remarks)}, all of them in the file that -o writes")
        for sentence in brief(remarks, 10):
            output.note(f"  {sentence}")
        print_written(output, written)


@dataclass(frozen=True, kw_only=True)
class PackTableCommand(TableCommand):
    """What tables of mesh packs share."""

    split: Annotated[str, arg(metavar="NAME")] = "val"
    """Whose shapes are the targets"""
    limit: Annotated[int | None, arg(metavar="N")] = None
    """At most so many targets a pack, drawn at random by the seed"""


@dataclass(frozen=True, kw_only=True)
class ModelOptions(Command):
    """Which models are measured or shown, and what they search."""

    model: Annotated[UseAppendAction[tuple[str, ...]], arg(metavar="NAME=FOLDER", help_behavior_hint="repeatable")] = ()
    """Trained networks and their name in the table; without any, the bundled ones"""
    database: Annotated[
        UseAppendAction[tuple[str, ...]], arg(metavar="NAME=FILE", help_behavior_hint="repeatable")
    ] = ()
    """Database (.kpred) that a model searches, of a single model FILE alone; without it, one built from the split
    `source` of each pack"""
    cache: Annotated[Path | None, arg(metavar="FOLDER")] = None
    """Keep the databases that are built in this folder, for the next table"""

    def named_models(self) -> dict[str, str | None]:
        """Return models by their name in the table."""
        return dict(named(self.model, "model")) or {BUNDLED: None}

    def named_databases(self) -> dict[str, str]:
        """Return databases by the name of the model that searches them."""
        models = self.named_models()
        alone = len(self.database) == len(models) == 1 and "=" not in self.database[0]
        words = [f"{next(iter(models))}={word}" if alone else word for word in self.database]
        found = dict(named(words, "database"))
        for name in found:
            if name not in models:
                raise UsageError(f"--database names the model {name}, but the models are {', '.join(models)}")
        return found


def named(words: Sequence[str], option: str) -> list[tuple[str, str]]:
    """Parse words NAME=PATH of an option that can be given several times; the name may be missing."""
    pairs = []
    for word in words:
        name, equals, value = word.partition("=")
        if not equals and option == "model":
            name, value = Path(word).name if word != BUNDLED else BUNDLED, word
        if not name or not value:
            raise UsageError(f"--{option} must be NAME=PATH, but is {word!r}")
        pairs.append((name, value))
    names = [name for name, _ in pairs]
    for name in names:
        if names.count(name) > 1:
            raise UsageError(f"--{option} names {name} twice; give each a name of its own, as in --{option} NAME=PATH")
    return pairs


@dataclass(frozen=True, kw_only=True)
class MeasuredCommand(PackTableCommand, ModelOptions):
    """Tables that measure the targets of packs by one plan."""

    kind: ClassVar[str] = "full"
    """Kind of the table (`kpred.evaluation.tables.config`)"""
    targets: Annotated[Path | None, arg(metavar="FILE")] = None
    """Only the targets named in this file: another table (.json), a split file (.csv with modelId and split), or one id
    a line"""

    peer: Annotated[UseAppendAction[tuple[str, ...]], arg(metavar="NAME=FOLDER", help_behavior_hint="repeatable")] = ()
    """Weights of a peer (`kpred train peer`) and its name in the table; its row counts as feed-forward"""

    def named_peers(self) -> list[tuple[str, str]]:
        """Return folders of peers by their name in the table."""
        return named(self.peer, "peer")

    def config(self) -> TableConfig:
        """Return the settings of the table, by the options that the command has."""
        from kpred.evaluation.tables.config import TableConfig

        options = {
            name: getattr(self, name) for name in ("occlusions", "oracle", "unknown_frame") if hasattr(self, name)
        }
        top_k: int | tuple[int, ...] = vars(self)["top_k"]
        numbers = top_k if isinstance(top_k, tuple) else (top_k,)
        return TableConfig(self.kind, self.split, self.limit, self.seed, numbers, **options)

    def check(self) -> None:
        """Refuse what cannot work before any work is done."""
        super().check()
        self.named_peers()
        self.named_databases()

    def measure(self, bar: ProgressBar) -> Table:
        """Measure models and peers."""
        from kpred.evaluation.tables.make_table import make_table
        from kpred.evaluation.tables.target_lists import read_target_list
        from kpred.peers.methods.peers import peer_method

        config = self.config()
        if self.targets is not None:
            config = replace(config, only=read_target_list(self.targets, self.split))
        return make_table(
            self.packs,
            self.named_models(),
            config,
            self.named_databases(),
            methods=[peer_method(name, folder) for name, folder in self.named_peers()],
            cache=self.cache,
            progress=bar.update,
            # The header holds what is left out, and `run` prints it.
            report=lambda sentence: None,
        )


def print_pages(output: Output, pages: Iterable[Page]) -> None:
    """Print laid out tables."""
    for page in pages:
        output.table(page.title, page.columns, page.rows)


def print_written(output: Output, files: Iterable[Path | None]) -> None:
    """Say which files were written."""
    for file in files:
        if file is not None:
            output.note(f"wrote {file}")
