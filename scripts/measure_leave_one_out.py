"""Fit each model of a database with the others of its category, retrieved or drawn at random.

    python scripts/measure_leave_one_out.py furniture.kpred [--model FOLDER] [--limit 8] [-o rows.json]

The model's surface is the scan: whole, in its known frame and category. Printed are means of the squared Chamfer
distance (x 10^3, unit box, both directions, to a second sample of the surface) of the best of ten deformed models,
retrieved by tokens and drawn at random, of the nearest undeformed model of all, and of the second sample itself.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import torch
from kpred.fitting.readings import deform_readings
from torch import Tensor

from kpred.database import Database
from kpred.evaluation.tables.targets import limited
from kpred.fitting.candidates import Candidates
from kpred.fitting.options import FitOptions
from kpred.fitting.selection import rank_candidates
from kpred.fitting.stages import CleanScan, Context, Tried, try_poses
from kpred.nn import load_model
from kpred.ops import chamfer_distance, sample_surface
from kpred.pose.recognition import PoseHypothesis
from kpred.refinement.config import RefineConfig
from kpred.refinement.structure_config import StructureConfig

TOP_K = 10
POINTS = 2048
MIN_MODELS = 4
"""Categories with fewer models are left out: there is nothing to choose from."""


@dataclass(frozen=True)
class Row:
    """Errors of one target, x 10^3."""

    model_id: str
    category: str
    retrieved: float
    random: float
    undeformed: float
    floor: float


def measure(context: Context, model_id: str, category: str, seed: int) -> Row:
    """Fit one model with the others of its category."""
    entry = context.database.entry(model_id)
    vertices = torch.from_numpy(entry.frame.to_unit(entry.mesh.vertices.astype(np.float64))).float()
    generator = torch.Generator().manual_seed(seed)
    scan, again = (
        sample_surface(vertices, torch.from_numpy(entry.mesh.faces).long(), POINTS, generator)[0] for _ in "ab"
    )
    count = len(context.database.model_ids(category))
    options = FitOptions(top_k=count, frame="known", partial=False, clean=False)
    cloud = CleanScan(scan.double().numpy(), len(scan), "y", None, ())
    tried = try_poses(cloud, [PoseHypothesis(np.eye(3), category)], context, options)
    found = tried.best.candidates
    others = [row for row, name in enumerate(found.model_ids) if name != model_id]
    drawn = np.random.default_rng(seed).permutation(others)[:TOP_K]
    goal = again[None].expand(len(others), -1, -1)
    return Row(
        model_id,
        category,
        best(found.take(torch.tensor(others[:TOP_K])), tried, again),
        best(found.take(torch.from_numpy(drawn)), tried, again),
        1000 * float(chamfer_distance(goal, found.points[others]).min()),
        1000 * float(chamfer_distance(again[None], scan[None])),
    )


def best(candidates: Candidates, tried: Tried, goal: Tensor) -> float:
    """Deform candidates as a fit does, and return the error of the one that it would deliver."""
    deformed = deform_readings(
        candidates, None, tried.visibility, "auto", refinement=RefineConfig(), structure=StructureConfig()
    )
    chosen = deformed.explanations[rank_candidates(deformed)[0]]
    return 1000 * float(chamfer_distance(goal[None], torch.from_numpy(chosen.points).float()[None]))


def line(name: str, rows: list[Row]) -> str:
    """Write one line of a Markdown table: means, and ratios of means."""
    retrieved, random, undeformed, floor = (
        float(np.mean([getattr(row, key) for row in rows])) for key in ("retrieved", "random", "undeformed", "floor")
    )
    cells = [f"{value:.2f}" for value in (retrieved, random, undeformed, floor)]
    cells += [f"{retrieved / undeformed:.2f}", f"{random / retrieved:.2f}"]
    return f"| {name} | {len(rows)} | " + " | ".join(cells) + " |"


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("database", type=Path)
    parser.add_argument("--model", default=None, help="networks that made the database")
    parser.add_argument("--categories", nargs="*", help="these alone")
    parser.add_argument("--limit", type=int, default=8, help="targets of each category")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("-o", "--output", type=Path, help="all rows, as JSON")
    options = parser.parse_args()
    torch.set_num_threads(1)
    rows: list[Row] = []
    print("| category | n | retrieved | random | undeformed | floor | retrieved / undeformed | random / retrieved |")
    print("|" + "---|" * 8)
    model = load_model(options.model)
    with Database.open(options.database, read_only=True) as database:
        for category in options.categories or database.categories():
            names = database.model_ids(category)
            if len(names) < MIN_MODELS or category not in model:
                continue
            context = Context(model, database, (category,))
            found = [
                measure(context, name, category, options.seed) for name in limited(names, options.limit, options.seed)
            ]
            print(line(category, found), flush=True)
            rows += found
    print(line("all", rows))
    if options.output is not None:
        options.output.write_text(json.dumps([asdict(row) for row in rows], indent=2) + "\n")


if __name__ == "__main__":
    main()
