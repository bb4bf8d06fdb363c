"""Printed measurements of scanned catalogue models: found again, and left as they are."""

from __future__ import annotations

from collections.abc import Iterator

from kpred.evaluation.page import Page
from kpred.evaluation.scans.catalogue_outcomes import CatalogueOutcome
from kpred.evaluation.scans.catalogue_summaries import FIRST, STEPS
from kpred.evaluation.scans.run import ScanReport
from kpred.evaluation.scans.summary_table import Column, SummaryTable


def catalogue_pages(report: ScanReport[CatalogueOutcome]) -> Iterator[Page]:
    """Lay out a report of scanned catalogue models."""
    table, header = SummaryTable(report.summaries), report.header
    views = int(header["views"])
    scanned = "whole surfaces" if views == 0 else f"{views} depth view{'s' if views > 1 else ''}"
    yield table.page(
        f"models of the database, scanned ({scanned}), up axis and category given; 95 % intervals",
        "right_model_first",
        [
            Column("n", table.count, "right_model_first"),
            Column("right model first", table.interval, "right_model_first"),
            Column(f"in {header['top_k']}", table.interval, "right_model_in_top_k"),
            Column("yaw < 15°", table.interval, "yaw_right"),
            Column("distance %", table.percent, "distance"),
            Column("failed", table.value, "failed"),
            Column("ms", table.value, "milliseconds"),
        ],
    )
    yield table.page(
        "where the right model is first: distance from the true surface to result and undeformed model, % of the "
        "longest side, medians; thickness of boards / own, median; fraction of boards within 10 %; steps chosen",
        "right_model_first",
        [
            Column("n", table.count, "distance", FIRST),
            Column("result", table.percent, "distance", FIRST),
            Column("undeformed", table.percent, "undeformed_distance", FIRST),
            Column("ratio", table.interval, "distance_ratio", FIRST),
            Column("thickness", table.interval, "board_thickness", FIRST),
            Column("kept", table.value, "boards_kept", FIRST),
            Column("yaw < 15°", table.value, "yaw_right", FIRST),
            *(Column(step, table.value, f"step_{step}", FIRST) for step in STEPS),
        ],
    )
