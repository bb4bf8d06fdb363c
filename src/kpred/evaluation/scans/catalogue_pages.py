"""Printed measurements of scanned catalogue models: found again, and left as they are."""

from __future__ import annotations

from collections.abc import Iterator

from kpred.evaluation.page import Page
from kpred.evaluation.scans.catalogue_outcomes import CatalogueOutcome
from kpred.evaluation.scans.catalogue_summaries import FIRST, STEPS
from kpred.evaluation.scans.run import ScanReport
from kpred.evaluation.scans.summary_table import SummaryTable


def catalogue_pages(report: ScanReport[CatalogueOutcome]) -> Iterator[Page]:
    """Lay out a report of scanned catalogue models."""
    table, header = SummaryTable(report.summaries), report.header
    views = int(header["views"])
    scanned = "whole surfaces" if views == 0 else f"{views} depth view{'s' if views > 1 else ''}"
    yield Page(
        f"models of the database, scanned ({scanned}), up axis and category given; 95 % intervals",
        ["data", "n", "right model first", f"in {header['top_k']}", "yaw < 15°", "distance %", "failed", "ms"],
        [
            (
                name,
                table.count(key, "right_model_first"),
                table.interval(key, "right_model_first"),
                table.interval(key, "right_model_in_top_k"),
                table.interval(key, "yaw_right"),
                table.percent(key, "distance"),
                table.value(key, "failed"),
                table.value(key, "milliseconds"),
            )
            for name, key in table.lines("right_model_first")
        ],
    )
    yield Page(
        "where the right model is first: distance from the true surface to result and undeformed model, % of the "
        "longest side, medians; thickness of boards / own, median; fraction of boards within 10 %; steps chosen",
        ["data", "n", "result", "undeformed", "ratio", "thickness", "kept", "yaw < 15°", *STEPS],
        [
            (
                name,
                table.count(key, "distance", FIRST),
                table.percent(key, "distance", FIRST),
                table.percent(key, "undeformed_distance", FIRST),
                table.interval(key, "distance_ratio", FIRST),
                table.interval(key, "board_thickness", FIRST),
                table.value(key, "boards_kept", FIRST),
                table.value(key, "yaw_right", FIRST),
                *(table.value(key, f"step_{step}", FIRST) for step in STEPS),
            )
            for name, key in table.lines("right_model_first")
        ],
    )
