"""`kpred evaluate compare`: two tables, target by target."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from kpred.cli.command import Command
from kpred.cli.output import Output
from kpred.cli.table_options import print_pages, print_written


@dataclass(frozen=True, kw_only=True)
class CompareCommand(Command):
    """Compare two tables by paired tests: the ratio of the means with its interval, and Wilcoxon's signed-rank test.

    The tables must be of one protocol, data, seed and set of targets, and differ in the model alone. To compare two
    models of one table, name the file twice. p values are not corrected for the number of rows. Errors are printed;
    --json and -o compare cleanliness as well.

    examples:
      kpred evaluate compare before.json after.json
      kpred evaluate compare full.json full.json --a kp-red --b kp-red-plus
    """

    first: Annotated[Positional[Path], arg(metavar="A.json")]
    """The table that is compared with: a file that -o of `kpred evaluate table` wrote"""
    second: Annotated[Positional[Path], arg(metavar="B.json")]
    """The other table; ratios below 1 say that it is better"""
    a: Annotated[str | None, arg(metavar="NAME")] = None
    """Model of the first table, if it has several"""
    b: Annotated[str | None, arg(metavar="NAME")] = None
    """Model of the second table, if it has several"""
    output: Annotated[Path | None, arg(aliases=["-o"], metavar="FILE")] = None
    """Write the comparison to this JSON file too"""

    def run(self, output: Output) -> None:
        """Compare, print and write."""
        from kpred.atomic import check_place
        from kpred.evaluation.tables.compare import compare, settings_changed
        from kpred.evaluation.tables.pages import comparison_pages
        from kpred.evaluation.tables.table import read_table
        from kpred.json_output import plain, write_json

        if self.output is not None:
            check_place(self.output)
        first, second = read_table(self.first), read_table(self.second)
        found = compare(first, second, self.a, self.b)
        report = plain(
            {
                "first": {"file": str(self.first), "model": self.a, "header": first.header},
                "second": {"file": str(self.second), "model": self.b, "header": second.header},
                "command": output.command,
                "rows": [one.to_json() for one in found],
            }
        )
        if self.output is not None:
            write_json(self.output, report)
        output.result(report)
        old, new = (header.get("versions", {}) for header in (first.header, second.header))
        changed = [name for name in old if name in new and old[name] != new[name]]
        for name in changed:
            output.note(f"note: {name} {old[name]} made the first table, {new[name]} the second")
        for line in settings_changed(first, second, self.a, self.b):
            output.note(f"note: the models differ in {line}")
        print_pages(output, comparison_pages(found))
        print_written(output, [self.output])
