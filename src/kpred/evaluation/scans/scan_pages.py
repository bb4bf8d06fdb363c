"""Printed measurements of virtual scans: errors, categories, and confidence against what is right."""

from __future__ import annotations

from collections.abc import Iterator

from kpred.evaluation.metrics.reliability import Reliability
from kpred.evaluation.metrics.symmetry import SYMMETRIES
from kpred.evaluation.page import Page
from kpred.evaluation.scans.summary_table import SummaryTable
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
    return Page(
        "nothing given but gravity (unknown), against frame, pose and category given (known); UCD from the whole true "
        "surface, unit box squared, true unit box; 95 % intervals",
        ["data", "n", "unknown", "known", "ratio", "yaw < 15°", "category", "right", "failed", "ms"],
        [
            (
                name,
                table.count(key, "category_right"),
                table.value(key, "ucd_whole_unknown"),
                table.value(key, "ucd_whole_known"),
                table.interval(key, "ucd_whole_ratio"),
                table.interval(key, "yaw_right"),
                table.interval(key, "category_right"),
                table.interval(key, "right"),
                table.value(key, "failed"),
                table.value(key, "milliseconds"),
            )
            for name, key in table.lines("category_right")
        ],
    )


def _errors(table: SummaryTable) -> Page:
    return Page(
        "errors: UCD from what the camera saw, unit box squared; box errors / the longest side; yaw, degrees, "
        "and fraction under 15 by symmetry",
        ["data", "seen, unknown", "seen, known", "ratio", "centre", "size", "yaw", "none", "half", "quarter", "round"],
        [
            (
                name,
                table.value(key, "ucd_visible_unknown"),
                table.value(key, "ucd_visible_known"),
                table.value(key, "ucd_visible_ratio"),
                table.value(key, "centre_error"),
                table.value(key, "size_error"),
                table.value(key, "yaw_error"),
                *(table.counted(key, "yaw_right", f"symmetry {symmetry.name}") for symmetry in SYMMETRIES),
            )
            for name, key in table.lines("category_right")
        ],
    )


def _others(table: SummaryTable) -> Page:
    return Page(
        "things of no known category: fractions",
        ["data", "n", "confidence < 0.5", "warned", "neither", "refused", "ms"],
        [
            (
                name,
                table.count(key, "other_warned"),
                *(table.value(key, f"other_{metric}") for metric in ("doubted", "warned", "unnoticed", "refused")),
                table.value(key, "other_milliseconds"),
            )
            for name, key in table.lines("other_warned")
        ],
    )
