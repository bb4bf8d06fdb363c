"""Printed measurements of whole rooms."""

from __future__ import annotations

from collections.abc import Iterator

from kpred.detection.networks import CATEGORIES
from kpred.evaluation.page import Page, with_interval
from kpred.evaluation.rooms.matching import right_rows
from kpred.evaluation.rooms.run import IOUS, RoomReport


def summary_page(report: RoomReport) -> Page:
    """Lay out summaries, one a row."""
    return Page(
        "rooms, nothing given; 95 % intervals in parentheses",
        ["rooms of", "category", "measure", "unit", "frame", "value", "n"],
        [
            (
                row.dataset,
                row.category,
                row.metric,
                row.unit,
                row.frame,
                with_interval(row.value, row.low, row.high, 3),
                row.n,
            )
            for row in report.summaries
        ],
    )


def room_page(report: RoomReport) -> Page:
    """Lay out rooms, one a row."""
    return Page(
        "rooms one by one: chairs, tables and cabinets shown, found, and right at each IoU of points",
        ["room", "points", "shown", "found", *(f"right at {iou}" for iou in IOUS), "aligned", "shared %", "seconds"],
        [
            (
                room.room,
                room.points,
                sum(name in CATEGORIES for name in room.shown.values()),
                len(room.matches),
                *(sum(right_rows(room.matches, iou)) for iou in IOUS),
                None if room.aligned is None else f"{len(room.aligned)} of {len(room.posed)}",
                None if room.interpenetration is None else round(100 * room.interpenetration, 2),
                round(room.seconds, 1),
            )
            for room in report.rooms
        ],
    )


def room_notes(report: RoomReport) -> Iterator[str]:
    """List rooms without a result."""
    yield from (f"{room.room}: {room.failure}" for room in report.rooms if room.failure is not None)
