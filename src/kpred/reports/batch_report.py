"""The report of a batch: what failed first, then every result, the least certain first, with pictures of some."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from kpred.reports.batch_tile import draw_failure, draw_result
from kpred.reports.page import page, section, tag, text_of
from kpred.reports.picture import picture
from kpred.reports.table import Html, meter, shown, sortable

MAX_ROWS = 5000
"""Rows of the table; of larger batches failures and the least certain results are listed."""

MAX_PICTURES = 200
"""Scans that are drawn, about 10 kB each; failures and the least certain results first."""

COLUMNS = ("scan", "status", "category", "model", "change", "error", "confidence", "warnings")


def batch_report(
    folder: Path,
    source: Path | None = None,
    progress: Callable[[int, int], None] | None = None,
    *,
    max_rows: int = MAX_ROWS,
    max_pictures: int = MAX_PICTURES,
) -> str:
    """Return the page of the output folder of a batch.

    Args:
        source: folder of the scans, where failed ones are looked for; None draws none of these.
        progress: called with the pictures drawn and all of them.
        max_rows, max_pictures: of larger batches failures and the least certain results are shown.
    """
    failures = list(_lines(folder / "failures.jsonl"))
    results = sorted(_lines(folder / "results.jsonl"), key=_confidence)
    rows = [_failed_row(one) for one in failures] + [_row(one) for one in results]
    figures = []
    drawn = min(len(rows), max_pictures)
    for number, one in enumerate((failures + results)[:max_pictures]):
        if progress is not None:
            progress(number, drawn)
        figures.append(_figure(one, folder, source, failed=number < len(failures)))
    counts = f"{len(results)} scans have a CAD model, {len(failures)} failed."
    if len(rows) > max_rows:
        counts += f" The table lists {max_rows} of them; {folder / 'results.jsonl'} has all."
    search = '<input id="search" type="search" placeholder="Find by name, category, model ..." aria-label="Find">'
    classes = ["failed"] * len(failures) + [""] * len(results)
    parts = [
        tag("p", text_of(counts), class_="lead"),
        tag("p", text_of(_summary(results)), class_="lead"),
        search,
        section("Contact sheet: failures first, then the least certain", tag("div", "".join(figures), class_="sheet")),
        section("All scans", sortable(COLUMNS, rows[:max_rows], classes)),
    ]
    return page(f"Batch {folder.name}", parts, ("sort.js",))


def _lines(file: Path) -> Iterator[dict[str, Any]]:
    """Yield the rows of a file of JSON lines that have a name; a broken line is left out."""
    if not file.is_file():
        return
    with open(file, encoding="utf-8", errors="replace") as stream:
        for line in stream:
            try:
                row = json.loads(line)
            except (ValueError, RecursionError):
                continue
            if isinstance(row, dict) and isinstance(row.get("name"), str):
                yield row


def _confidence(row: dict[str, Any]) -> float:
    value = row.get("confidence")
    return float(value) if isinstance(value, int | float) else 0.0


def _row(one: dict[str, Any]) -> list[Any]:
    error = one.get("error")
    found = [one["name"], "fitted", *(shown(one.get(key)) for key in ("category", "model_id", "step"))]
    return [
        *found,
        error if isinstance(error, int | float) else None,
        meter(_confidence(one)),
        one.get("warnings") if isinstance(one.get("warnings"), int) else None,
    ]


def _failed_row(one: dict[str, Any]) -> list[Any]:
    problem = Html(tag("span", text_of(one.get("problem", "")), class_="problem"), "failed")
    return [one["name"], problem, *[None] * (len(COLUMNS) - 2)]


def _summary(results: list[dict[str, Any]]) -> str:
    if not results:
        return ""
    sure = sum(_confidence(one) >= 0.8 for one in results)
    doubtful = sum(bool(one.get("warnings")) for one in results)
    return f"Confidence of at least 0.8: {sure}; with warnings: {doubtful}."


def _figure(one: dict[str, Any], folder: Path, source: Path | None, failed: bool) -> str:
    image = draw_failure(one["name"], source) if failed else draw_result(one, folder)
    drawing = "" if image is None else picture(image, "scan" if failed else "scan, result, both")
    words = tag("b", text_of(one["name"]))
    if failed:
        words += tag("p", text_of(one.get("problem", "")), class_="problem")
    else:
        words += f"<br>{text_of(shown(one.get('category')))} {meter(_confidence(one)).content}"
    return tag("figure", drawing + tag("figcaption", words), class_="failed" if failed else "")
