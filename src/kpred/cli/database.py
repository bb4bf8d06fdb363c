"""`kpred database`: the CAD models that are retrieved and deformed."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from tyro.conf import Positional, arg

from kpred.cli.command import Command, NetworkCommand
from kpred.cli.database_build import AddCommand, BuildCommand, DatabasePath
from kpred.cli.database_check import CheckCommand
from kpred.cli.database_get import GetCommand
from kpred.cli.database_transfer import CopyCommand, UpdateCommand
from kpred.cli.output import Output
from kpred.cli.usage import UsageError
from kpred.database.address import masked


@dataclass(frozen=True, kw_only=True)
class RemoveCommand(Command):
    """Remove models from a database by their ids; all of them or, when one is not there, none.

    examples:
      kpred database remove mine.kpred chair_0001 chair_0007
    """

    file: DatabasePath
    """An existing database: a file or postgresql://user@host/name"""
    model_ids: Annotated[Positional[tuple[str, ...]], arg(metavar="MODEL_ID [MODEL_ID ...]", help_behavior_hint="")]
    """Ids of the models"""

    def run(self, output: Output) -> None:
        """Remove and print the number."""
        from kpred.database import Database

        if not self.model_ids:
            raise UsageError("no model was named; `kpred database list` shows what there is")
        with Database.open(self.file) as database:
            removed = database.remove(self.model_ids)
        output.result({"path": masked(self.file), "removed": removed})
        output.note(f"{masked(self.file)}: {removed} removed")


@dataclass(frozen=True, kw_only=True)
class InfoCommand(Command):
    """Say what a database holds, and which weights made it.

    examples:
      kpred database info mine.kpred
      kpred database info mine.kpred --ids --json
    """

    file: DatabasePath
    """An existing database: a file or postgresql://user@host/name"""
    ids: Annotated[bool, arg(help_behavior_hint="")] = False
    """List the ids of the models too"""

    def run(self, output: Output) -> None:
        """Print the facts."""
        from kpred.database import Database

        with Database.open(self.file, read_only=True) as database:
            facts = database.info()
            ids = {name: database.model_ids(name) for name in facts["categories"]} if self.ids else {}
        output.result(facts | ({"model_ids": ids} if self.ids else {}))
        rows = [
            (name, c["models"], c["keypoints"], c["token_size"], c["model_name"], c["fingerprint"])
            for name, c in facts["categories"].items()
        ]
        title = f"{facts['path']}: {facts['models']} models, {facts['bytes'] / 1e6:.1f} MB"
        output.table(title, ["category", "models", "keypoints", "token", "model", "weights"], rows)
        for licence, count in facts["licences"].items():
            if licence:
                output.note(f"{count} under {licence}; `kpred database list` names authors and sources")
        for name, model_ids in ids.items():
            output.note("\n".join(f"{name}  {model_id}" for model_id in model_ids))


@dataclass(frozen=True, kw_only=True)
class ListCommand(Command):
    """List the models of a database with their titles, authors, licences, sources and sizes.

    examples:
      kpred database list furniture.kpred
      kpred database list furniture.kpred --category chair --json
    """

    file: DatabasePath
    """An existing database: a file or postgresql://user@host/name"""
    category: Annotated[str | None, arg(metavar="NAME")] = None
    """List this category only"""

    def run(self, output: Output) -> None:
        """Print a row a model."""
        from kpred.database import Database

        with Database.open(self.file, read_only=True) as database:
            found = database.all_metadata(self.category)
        output.result([{"model_id": name, **facts} for name, facts in found.items()])
        columns = ("category", "title", "author", "licence", "source", "size", "faces")
        rows = [
            [name, *(facts.get(key) if key != "size" else _size(facts) for key in columns)]
            for name, facts in found.items()
        ]
        output.table(f"{masked(self.file)}: {len(found)} models", ["model", *columns], rows)


def _size(facts: dict[str, Any]) -> str | None:
    """Format width, height and depth as one cell, where they are known."""
    sides = [facts.get(key) for key in ("width", "height", "depth")]
    return None if None in sides else " x ".join(map(str, sides)) + " m"


@dataclass(frozen=True, kw_only=True)
class SearchCommand(NetworkCommand):
    """List the models of a database that retrieval finds for a scan, nearest first.

    examples:
      kpred database search mine.kpred chair.ply --category chair
      kpred database search mine.kpred scan.npy --top-k 25 --json
    """

    file: DatabasePath
    """An existing database: a file or postgresql://user@host/name"""
    scan: Annotated[Positional[Path], arg(metavar="SCAN")]
    """Point cloud or mesh of one object"""
    category: Annotated[str | None, arg(metavar="NAME")] = None
    """Search this category; without it, the one that fits best"""
    top_k: Annotated[int, arg(metavar="K")] = 10
    """How many models to list"""

    def run(self, output: Output) -> None:
        """Search and print the models."""
        from kpred.database import Database
        from kpred.fitting.pipeline import fit
        from kpred.nn import load_model
        from kpred.shapes import read_scan

        scan = read_scan(self.scan)
        with Database.open(self.file, read_only=True) as database:
            model = load_model(self.model)
            result = fit(scan, model, database, category=self.category, top_k=self.top_k, deform="none")
        rows = [
            {"model_id": found.model_id, "category": found.category, "token_distance": found.distance}
            for found in sorted(result.candidates, key=lambda found: found.distance)
        ]
        output.result(rows)
        output.table(f"models for {self.scan}", list(rows[0]), [list(row.values()) for row in rows])


COMMAND: dict[str, type[Command]] = {
    "build": BuildCommand,
    "add": AddCommand,
    "remove": RemoveCommand,
    "info": InfoCommand,
    "list": ListCommand,
    "check": CheckCommand,
    "search": SearchCommand,
    "copy": CopyCommand,
    "get": GetCommand,
    "update": UpdateCommand,
}
