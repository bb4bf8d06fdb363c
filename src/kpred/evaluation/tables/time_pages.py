"""Printed times: what each row costs for one target, and how long its networks were trained."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from kpred.evaluation.page import Page
from kpred.evaluation.tables.table import Table


def time_pages(table: Table) -> Iterator[Page]:
    """Lay out the processor's time of every row for one target, if it was measured."""
    rows = [
        [
            row["model"],
            str(row["method"]).replace("_", " "),
            f"{row['mean']:.3f}",
            row["n"],
            _steps(table.header["models"].get(row["model"], {})),
        ]
        for row in table.header.get("processor_seconds", [])
    ]
    if rows:
        yield Page(
            f"processor seconds for one target, with the rows of the model above it: {table.header['machine']}",
            ["model", "method", "seconds", "n", "training"],
            rows,
        )


def _steps(provenance: Mapping[str, Any]) -> str:
    """Write how many steps a peer was trained in each category, as its record says."""
    found = []
    for record in provenance.get("training") or []:
        stage = record["training"]["optimisation"]
        steps = record.get("stopped_after", stage["steps"])
        found.append(f"{record.get('category', '')} {steps} steps of {stage['batch']}".strip())
    return ", ".join(found)
