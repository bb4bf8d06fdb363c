"""Printed measurements of virtual scans: errors, categories, and confidence against what is right."""

from __future__ import annotations

from collections.abc import Iterator

from kpred.evaluation.metrics.reliability import Reliability
from kpred.evaluation.metrics.symmetry import SYMMETRIES
from kpred.evaluation.page import Page
from kpred.evaluation.scans.summary_table import Column, SummaryTable
from kpred.evaluation.scans.virtual_scans import ScansReport


def scan_pages(report: ScansReport) -> Iterator[Page]:
    """Lay out a report of virtual scans."""
    table = SummaryTable(report.summaries)
    yield _results(table)
    yield _errors(table)
    if table.lines("other_warned"):
        yield _others(table)
    found = sorted({name for counts in report.confusion.values() for name in counts})
    yield Page(
        "category found (columns) of the true category (rows)",
        ["", *found],
        [(true, *(counts.get(name, 0) for name in found)) for true, counts in report.confusion.items()],
    )
    if report.reliability is not None:
        yield reliability_page(report.reliability)


def reliability_page(found: Reliability) -> Page:
    """Lay out bins of confidence; the title says ECE and AUC."""
    auc = "" if found.auc is None else f", area under ROC {found.auc:.3f}"
    return Page(
        f"confidence of {found.n} results against what is right: expected calibration error {found.ece:.3f}{auc}",
        ["confidence", "mean", "fraction right", "n"],
        [(f"{part.low:.1f} to {part.high:.1f}", part.confidence, part.right, part.n) for part in found.bins],
    )


def _results(table: SummaryTable) -> Page:
    return table.page(
        "nothing given but gravity (unknown), against frame, pose and category given (known); UCD from the whole true "
        "surface, unit box squared, true unit box; 95 % intervals",
        "category_right",
        [
            Column("n", table.count, "category_right"),
            Column("unknown", table.value, "ucd_whole_unknown"),
            Column("known", table.value, "ucd_whole_known"),
            Column("ratio", table.interval, "ucd_whole_ratio"),
            Column("yaw < 15°", table.interval, "yaw_right"),
            Column("category", table.interval, "category_right"),
            Column("right", table.interval, "right"),
            Column("failed", table.value, "failed"),
            Column("ms", table.value, "milliseconds"),
        ],
    )


def _errors(table: SummaryTable) -> Page:
    heads = ("none", "half", "quarter", "round")
    return table.page(
        "errors: UCD from what the camera saw, unit box squared; box errors / the longest side; yaw, degrees, "
        "and fraction under 15 by symmetry",
        "category_right",
        [
            Column("seen, unknown", table.value, "ucd_visible_unknown"),
            Column("seen, known", table.value, "ucd_visible_known"),
            Column("ratio", table.value, "ucd_visible_ratio"),
            Column("centre", table.value, "centre_error"),
            Column("size", table.value, "size_error"),
            Column("yaw", table.value, "yaw_error"),
            *(
                Column(head, table.counted, "yaw_right", f"symmetry {symmetry.name}")
                for head, symmetry in zip(heads, SYMMETRIES, strict=True)
            ),
        ],
    )


def _others(table: SummaryTable) -> Page:
    return table.page(
        "things of no known category: fractions",
        "other_warned",
        [
            Column("n", table.count, "other_warned"),
            Column("confidence < 0.5", table.value, "other_doubted"),
            Column("warned", table.value, "other_warned"),
            Column("neither", table.value, "other_unnoticed"),
            Column("refused", table.value, "other_refused"),
            Column("ms", table.value, "other_milliseconds"),
        ],
    )
