"""Fit every real crop of a folder with nothing given, and count what comes out near the scan and in its category.

    python benchmarks/real_crops.py FOLDER

FOLDER holds <category>_<nn>.ply, y up, in metres. Distances are means from scan points to the result, in metres, in the
scan's own frame; frame, yaw, completeness and category are all found by the fit.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import kpred


def main() -> None:
    """Fit, count, print."""
    rows = []
    for file in sorted(Path(sys.argv[1]).glob("*.ply")):
        fit = kpred.fit(file)
        distance = next(metric.value for metric in fit.metrics if metric.name == "mean_scan_to_result")
        rows.append({"file": file.name, "found": fit.category, "mean_scan_to_result_m": round(distance, 4)})
    near = sum(row["mean_scan_to_result_m"] < 0.04 for row in rows)
    right = sum(row["file"].split("_")[0] == row["found"] for row in rows)
    print(json.dumps({"n": len(rows), "under_4_cm": near, "category_right": right, "rows": rows}, indent=2))


if __name__ == "__main__":
    main()
