"""Measure how well a visibility network knows what scanners would have seen, on shapes of mesh packs.

    python scripts/measure_visibility.py PACK.npz [...] [--weights FOLDER] [--split val] [--limit N] [-o rows.json]

Scans of each shape are whole, cut by planes, one depth view, and merged views, in the known unit box. The table shows
mean probabilities on surfaces that are seen and hidden, the fraction of misread scans, the areas under the ROC curves
and the calibration error; see `kpred.evaluation.metrics.visibility`.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import torch

from kpred.evaluation.metrics.visibility import as_values, measure_visibility
from kpred.nn import load_visibility
from kpred.nn.loading import VISIBILITY, bundled_model_path
from kpred.shapes.pack import MeshPack

COLUMNS = {
    "seen": "seen",
    "hidden": "hidden",
    "other_seen": "seen, other",
    "other_hidden": "hidden, other",
    "misread": "misread",
    "auc": "AUC",
    "other_auc": "AUC, other",
    "calibration": "ECE",
}


def main() -> None:
    """Measure every pack and print a Markdown table; write the rows if a file is named."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("packs", type=Path, nargs="+")
    parser.add_argument("--weights", type=Path, default=bundled_model_path() / VISIBILITY)
    parser.add_argument("--split", default="val")
    parser.add_argument("--limit", type=int, help="shapes of each pack")
    parser.add_argument("--points", type=int, default=2048, help="points of a scan")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("-o", "--output", type=Path)
    options = parser.parse_args()
    torch.set_num_threads(1)
    network = load_visibility(options.weights)
    found = []
    print(f"| pack | scans | {' | '.join(COLUMNS.values())} |")
    print(f"|---|---|{'---|' * len(COLUMNS)}")
    for path in options.packs:
        pack = MeshPack.load(path)
        dataset = f"{path.resolve().parent.name} {pack.category}"
        for row in measure_visibility(network, pack, options.split, options.points, options.limit, options.seed):
            values = as_values(row)
            found.append({"pack": dataset, "split": options.split, "points": options.points, **values})
            numbers = " | ".join("" if values[name] is None else f"{values[name]:.3f}" for name in COLUMNS)
            print(f"| {dataset} | {row.case} | {numbers} |")
    if options.output is not None:
        options.output.write_text(json.dumps(found, indent=2) + "\n")


if __name__ == "__main__":
    main()
