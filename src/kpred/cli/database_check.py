"""`kpred database check`: what is doubtful about the models of a database."""

from __future__ import annotations

import collections
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

from tyro.conf import arg

from kpred.cli.command import Command
from kpred.cli.database_build import DatabasePath
from kpred.cli.output import Output
from kpred.database.address import masked

if TYPE_CHECKING:
    from kpred.database.doubts import Doubt

MAX_ROWS = 5
"""Models that are listed for one sentence; where it is said of more, their number is."""


@dataclass(frozen=True, kw_only=True)
class CheckCommand(Command):
    """Name the models whose front, size, licence or mesh is doubtful, and what to do about it.

    Fronts are guessed by the recognizer, and only shown: correct them in the column `front` of the manifest, build
    again with --update, and look at `kpred plot catalogue`.

    examples:
      kpred database check mine.kpred
      kpred database check mine.kpred --json
    """

    file: DatabasePath
    """An existing database: a file or postgresql://user@host/name"""
    model: Annotated[str | None, arg(metavar="NAME_OR_PATH")] = None
    """Trained networks, whose recognizer guesses fronts; without it, the bundled ones"""

    def run(self, output: Output) -> None:
        """Check with a progress bar; print a row a doubt, and how many of each kind."""
        from kpred.cli.progress import ProgressBar
        from kpred.database import Database
        from kpred.database.doubts import check_models
        from kpred.nn import load_model

        model = load_model(self.model)
        with Database.open(self.file, read_only=True) as database, ProgressBar() as bar:
            recognizer = model.recognizer_of(database.categories()) or model.shared_recognizer or model.recognizer
            doubts = list(check_models(database, recognizer, lambda done, total: bar.update("models", done, total)))
            count = len(database)
        output.result([doubt._asdict() for doubt in doubts])
        if doubts:
            output.table(f"{masked(self.file)}: what is doubtful", ["model", "kind", "what"], _rows(doubts))
        kinds = ", ".join(f"{kind} {n}" for kind, n in collections.Counter(d.kind for d in doubts).items())
        output.note(f"{count} models checked; {kinds or 'nothing is doubtful'}")


def _rows(doubts: Iterable[Doubt]) -> list[tuple[str, str, str]]:
    """List a row a doubt; what is said of many models alike is one row."""
    models = collections.defaultdict[tuple[str, str], list[str]](list)
    for doubt in doubts:
        models[doubt.kind, doubt.sentence].append(doubt.model_id)
    return [
        (name, kind, sentence)
        for (kind, sentence), names in models.items()
        for name in (names if len(names) <= MAX_ROWS else [f"{len(names)} models, {names[0]} and others"])
    ]
