"""Measure fits of the labelled instances of real rooms, each alone, its label hidden, gravity given.

    python scripts/measure_room_instances.py ROOMS_FOLDER [--model FOLDER] [--database FILE] [-o rows.json]

A folder of rooms holds NAME.ply (z up, metres), NAME.instances.npy (number of each point's instance) and
NAME.names.json (name of each number). Names that say neither furniture nor another known thing are left out.
What counts as furniture are the categories of the database.
"""

from __future__ import annotations

import argparse
import collections
import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np

import kpred
from kpred.database import Database
from kpred.errors import KpredError
from kpred.evaluation.rooms.labelled import FURNITURE, MIN_POINTS, UNNAMED
from kpred.fitting.defaults import resolve_database, resolve_model
from kpred.nn import Model
from kpred.scenes.scene import read_scene

LEFT_OUT = {*UNNAMED, "wall", "floor", "ceiling"}
CONFIDENT = 0.5

CATEGORIES = FURNITURE | {name: name for name in ("sofa", "bed", "lamp", "curtain", "door", "window", "mirror", "box")}
CATEGORIES["television"] = "display"
"""Categories of the names that labels give, of databases of more than chairs, tables and cabinets."""


def instances(folder: Path) -> Iterator[tuple[str, str, np.ndarray]]:
    """Yield room, name and points (N, 3) of each instance of a known name."""
    for file in sorted(folder.glob("*.names.json")):
        room = file.name.removesuffix(".names.json")
        names = json.loads(file.read_text())
        numbers = np.load(folder / f"{room}.instances.npy")
        points = read_scene(folder / f"{room}.ply").points
        for number, name in enumerate(names):
            chosen = points[numbers == number]
            if number and name not in LEFT_OUT and len(chosen) >= MIN_POINTS:
                yield room, name, chosen


def measure(room: str, name: str, points: np.ndarray, model: Model, database: Database) -> dict[str, object]:
    """Fit one instance; report what was found."""
    true = CATEGORIES.get(name, "other")
    true = true if true in database.categories() else "other"
    row: dict[str, object] = {"room": room, "name": name, "true": true, "points": len(points)}
    try:
        found = kpred.fit(points, model, database, up="z")
    except KpredError as error:
        return row | {"found": None, "confidence": 0.0, "error": str(error)}
    return row | {"found": found.category, "confidence": found.confidence, "warnings": list(found.warnings)}


def summary(rows: list[dict[str, object]]) -> list[str]:
    """Lines that report the measures of all rows."""
    known = [row for row in rows if row["true"] != "other"]
    right = [row for row in known if row["found"] == row["true"]]
    others = [row for row in rows if row["true"] == "other"]
    sure = [row for row in right if float(str(row["confidence"])) >= CONFIDENT]
    doubted = [row for row in others if float(str(row["confidence"])) < CONFIDENT]
    wrong = collections.Counter(f"{row['name']} -> {row['found']}" for row in known if row not in right)
    taken = collections.Counter(f"{row['name']} -> {row['found']}" for row in others if row not in doubted)
    three = [row for row in known if row["true"] in ("chair", "table", "cabinet")]
    return [
        f"category right: {len(right)} of {len(known)}",
        f"of these chairs, tables, cabinets: {sum(row in right for row in three)} of {len(three)}",
        f"of these confidence >= {CONFIDENT}: {len(sure)} of {len(right)}",
        f"other things with confidence < {CONFIDENT}: {len(doubted)} of {len(others)}",
        f"wrong: {dict(wrong)}",
        f"other things taken for furniture: {dict(taken)}",
    ]


def main() -> None:
    """Parse the command line, measure, print, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--model", default=None, help="a model's name or folder; without it, the bundled one")
    parser.add_argument("--database", type=Path, default=None, help="a database; without it, the bundled one")
    parser.add_argument("-o", "--output", type=Path, default=None)
    options = parser.parse_args()
    model = resolve_model(options.model)
    database = resolve_database(options.database)
    rows = [measure(*instance, model, database) for instance in instances(options.folder)]
    print("\n".join(summary(rows)))
    if options.output is not None:
        options.output.write_text(json.dumps(rows, indent=1) + "\n")


if __name__ == "__main__":
    main()
