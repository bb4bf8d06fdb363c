"""What every command has: the options --json and --debug, and a `run` that does the work."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar

from tyro.conf import arg

from kpred.cli.output import Output


@dataclass(frozen=True, kw_only=True)
class Command:
    """One command of the command line; its fields are its options."""

    fits: ClassVar[bool] = False
    """Whether it fits scans: it reports when code is being compiled first"""
    json: Annotated[bool, arg(help_behavior_hint="")] = False
    """Print the result as JSON on standard output, all else on standard error"""
    debug: Annotated[bool, arg(help_behavior_hint="")] = False
    """Show the traceback of an error"""

    @property
    def compiles(self) -> bool:
        """Whether this call may compile code first; a fit by a server does not."""
        return self.fits

    @abstractmethod
    def run(self, output: Output) -> None:
        """Do the work and print its result. Raises KpredError for what the user can mend."""


@dataclass(frozen=True, kw_only=True)
class NetworkCommand(Command):
    """A command that works with trained networks."""

    model: Annotated[str | None, arg(metavar="NAME_OR_PATH")] = None
    """Trained networks: a name or a folder; without it, the bundled ones"""


@dataclass(frozen=True, kw_only=True)
class FitsCommand(NetworkCommand):
    """A command that fits, or describes what fits need: networks and a database."""

    database: Annotated[Path | None, arg(metavar="FILE")] = None
    """CAD database (.kpred); without it, the bundled one"""


class Group(dict[str, "type[Command] | Group"]):
    """Commands by their words, a group within another; `summary` is one line about it."""

    def __init__(self, commands: Mapping[str, type[Command] | Group], summary: str = "") -> None:
        super().__init__(commands)
        self.summary = summary
