"""Measure a model: how much closer than the nearest CAD model as it is, and than deformation without learning?

    python examples/05_evaluate.py [output folder]

`kpred evaluate shapes PACK -o rows.json` does the same from the command line; `kpred evaluate scans PACK` fits virtual
scans of the same shapes with nothing given but gravity.
"""

import sys
from pathlib import Path

from kpred import load_model
from kpred.evaluation.tables.config import TableConfig
from kpred.evaluation.tables.make_table import make_table
from kpred.evaluation.tables.table import write_table
from kpred.shapes import MeshPack
from kpred.synthetic.generator import generate

folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path("kpred-examples")
folder.mkdir(parents=True, exist_ok=True)

# A mesh pack says which shapes are searched (split source) and which are the targets (split val).
chairs = generate("chair", 24, seed=123, splits=False)
splits = ["val" if row % 12 == 0 else "source" for row in range(len(chairs))]
file = folder / "chair.npz"
MeshPack.from_meshes(list(chairs), list(chairs.model_id), splits, "chair").save(file)

# All metrics are computed on the same clouds; best of the first 1 and of the first 10 retrieved models.
table = make_table([file], {"bundled": load_model()}, TableConfig("all", top_k=(1, 10), occlusions=(0.5,)))

for cell in table.cells():
    series, metric = cell.series, cell.series.metric
    if metric.is_error:
        top = "all" if metric.top_k is None else metric.top_k
        hidden = f"{series.protocol}, {series.occlusion:.0%} hidden" if series.occlusion else series.protocol
        interval = "" if cell.low is None else f"({cell.low:.5f} to {cell.high:.5f})"
        print(f"{hidden:<22} {series.method:<26} {metric.surface:<6} top {top!s:<4} {cell.value:.5f} {interval}")

# Values, target by target, and what they were made by (weights, database, seed, versions), for comparing runs.
for written in write_table(table, folder / "table.json"):
    print(f"wrote {written}")
print(f"unit: {table.header['unit']}, mean over {len(table.subjects())} shapes")
