"""Scan models of a catalogue that nobody trained on, and see whether they are found again and how they are deformed.

    python scripts/measure_foreign_catalogue.py furniture.kpred -o foreign/ [--limit 15] [--step auto]

Each model is scanned by one virtual depth camera, in its own size, turned and moved, and fitted against the database
that holds it, with its up axis and category given. Written are `rows.json`, and a contact sheet for each category with
four pictures a model: scan, result, the result's model as it is in the database, truth. Distances are means from the
true surface, in % of the true longest side; `ratio` is that of the result over that of the undeformed model in place.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import torch
import trimesh
from PIL import Image, ImageDraw, ImageFont

from kpred.database import Database
from kpred.evaluation.metrics.surfaces import Surface
from kpred.evaluation.metrics.symmetry import yaw_between, yaw_error
from kpred.evaluation.scans.outcome import FailedFit, FitSettings, moved, try_fit
from kpred.evaluation.scans.targets import ScanTarget, make_scan_target
from kpred.evaluation.tables.targets import limited
from kpred.nn import load_model
from kpred.rendering.contact_sheet import Tile, draw_tile
from kpred.shapes.mesh import Mesh

COLUMNS = 2
LINE = 18


@dataclass(frozen=True)
class Row:
    """What became of one model; `rank`: of the right model among the candidates, 0 where it is not among them."""

    model_id: str
    category: str
    found: str = ""
    rank: int = 0
    step: str = ""
    yaw: float = float("nan")
    distance: float = float("nan")
    undeformed: float = float("nan")
    flatness: float = float("nan")
    squareness: float = float("nan")
    failure: str = ""

    @property
    def ratio(self) -> float:
        """Distance of the result over that of the undeformed model."""
        return self.distance / max(self.undeformed, 1e-9)


def measure(target: ScanTarget, mesh: Mesh, category: str, settings: FitSettings) -> tuple[Row, np.ndarray]:
    """Fit one scan; return the numbers and the pictures side by side."""
    found = try_fit(target.scan, settings, up="y", category=category)
    truth = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    low, high = truth.bounds
    truth.apply_translation(-(low + high) / 2)
    truth.apply_scale(2 / float((high - low).max()))
    if isinstance(found, FailedFit):
        pictures = (draw_tile(Tile((), "open", target.known, one)) for one in (None, truth))
        return Row(target.model_id, category, failure=found.reason), np.concatenate(list(pictures), axis=1)[:, :1040]
    meshes = [moved(one, target.frame) for one in (found.mesh, found.retrieved_mesh)]
    side = float((target.high - target.low).max())
    result, undeformed = (100 * float(Surface(one).distances(target.whole).mean()) / side for one in meshes)
    names = [one.model_id for one in found.candidates]
    row = Row(
        target.model_id,
        category,
        found.source.model_id,
        names.index(target.model_id) + 1 if target.model_id in names else 0,
        found.source.step,
        float(yaw_error(yaw_between(found.frame.rotation, target.frame.rotation), target.symmetry)),
        result,
        undeformed,
        100 * found.cleanliness.flatness,
        found.cleanliness.squareness,
    )
    panels = [draw_tile(Tile((), "open", target.known, one)) for one in (*meshes, truth)]
    width = panels[0].shape[1] // 3
    shown = [panels[0][:, :width], *(panel[:, width : 2 * width] for panel in panels)]
    return row, np.concatenate(shown, axis=1)


def sheet(rows: list[Row], pictures: list[np.ndarray]) -> Image.Image:
    """All models of a category, the worst first."""
    height, width = pictures[0].shape[0] + 2 * LINE, pictures[0].shape[1] + 10
    image = Image.new("RGB", (COLUMNS * width, -(-len(rows) // COLUMNS) * height), "white")
    pen, font = ImageDraw.Draw(image), ImageFont.load_default(size=14)
    order = sorted(range(len(rows)), key=lambda i: (not rows[i].failure, rows[i].rank == 1, -rows[i].distance))
    for place, number in enumerate(order):
        row, left, top = rows[number], place % COLUMNS * width, place // COLUMNS * height
        color = (40, 110, 60) if row.rank == 1 else (190, 40, 40)
        found = "itself" if row.rank == 1 else f"{row.found} (right model: {row.rank or 'not in ten'})"
        pen.text((left + 6, top), f"{row.model_id}: found {found} {row.failure}", color, font)
        numbers = f"{row.step}; {row.distance:.2f} %, undeformed {row.undeformed:.2f} %, ratio {row.ratio:.2f}"
        more = f"; yaw off {row.yaw:.0f} deg; bent {row.flatness:.2f} %, angles {row.squareness:.2f} deg"
        pen.text((left + 6, top + LINE - 2), numbers + more, (60, 60, 60), font)
        image.paste(Image.fromarray(pictures[number]), (left, top + 2 * LINE - 2))
    return image


def summary(rows: list[Row]) -> str:
    """One line of a Markdown table."""
    done = [row for row in rows if not row.failure]
    first = [row for row in done if row.rank == 1]
    quantile = np.median
    cells = [
        len(rows),
        len(first),
        sum(1 <= row.rank <= 10 for row in done),
        sum(row.yaw <= 15 for row in done),
        f"{quantile([row.distance for row in done]):.2f}",
        f"{quantile([row.undeformed for row in done]):.2f}",
        f"{quantile([row.ratio for row in done]):.2f}",
        sum(row.ratio > 1.05 for row in done),
        f"{quantile([row.ratio for row in first]):.2f}" if first else "",
        sum(row.ratio > 1.05 for row in first),
        len(rows) - len(done),
    ]
    return " | ".join(map(str, cells))


def main() -> None:
    """Measure and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("database", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder for rows and pictures")
    parser.add_argument("--limit", type=int, default=15, help="models of each category")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    torch.set_num_threads(1)
    options.output.mkdir(parents=True, exist_ok=True)
    everything: list[Row] = []
    print(
        "| category | n | first | in ten | yaw < 15 | distance % | undeformed % | ratio | worse | ratio, first |",
        end="",
    )
    print(" worse, first | failed |\n|" + "---|" * 12)
    model = load_model()
    with Database.open(options.database, read_only=True) as database:
        settings = FitSettings(model, database, 10, options.seed)
        for category in model.categories:
            rows, pictures = [], []
            for name in limited(database.model_ids(category), options.limit, options.seed):
                mesh = database.entry(name).mesh
                target = make_scan_target(mesh, name, options.seed, own_size=True)
                row, picture = measure(target, mesh, category, settings)
                rows.append(row)
                pictures.append(picture)
            sheet(rows, pictures).save(options.output / f"{category}.png")
            print(f"| {category} | {summary(rows)} |", flush=True)
            everything += rows
    print(f"| all | {summary(everything)} |")
    values = [asdict(row) | {"ratio": row.ratio} for row in everything]
    (options.output / "rows.json").write_text(json.dumps(values, indent=2) + "\n")


if __name__ == "__main__":
    main()
