"""Measure a model: how much closer than the nearest CAD model as it is, and than deformation without learning?

    python examples/05_evaluate.py [output folder]

`kpred evaluate shapes PACK -o rows.json` does the same from the command line; `kpred evaluate scans PACK` fits virtual
scans of the same shapes with nothing given but gravity.
"""

import sys
from pathlib import Path

from kpred import load_model
from kpred.evaluation import evaluate, run_header, write_rows
from kpred.shapes import MeshPack
from kpred.synthetic.generator import generate

folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path("kpred-examples")
folder.mkdir(parents=True, exist_ok=True)

# A mesh pack says which shapes are searched (split source) and which are the targets (split val).
chairs = generate("chair", 32, seed=123, splits=False)
splits = ["val" if row % 8 == 0 else "source" for row in range(len(chairs))]
file = folder / "chair.npz"
MeshPack.from_meshes(list(chairs), list(chairs.model_id), splits, "chair").save(file)

# All metrics are computed on the same clouds; best of the first 1 and of the first 10 retrieved models.
settings = {"split": "val", "top_k": (1, 10), "protocol": "all", "occlusions": (0.5,), "seed": 0}
model = load_model()
rows = evaluate([file], model, **settings)

for row in (row for row in rows if row.unit == "unit box squared"):  # the other rows measure cleanliness
    top = "all" if row.top_k is None else row.top_k
    ratio = "" if row.ratio_to_undeformed is None else f"{row.ratio_to_undeformed:.2f} of undeformed"
    hidden = f"{row.protocol}, {row.occlusion:.0%} hidden" if row.protocol == "partial" else row.protocol
    print(f"{hidden:<22} {row.metric:<26} top {top!s:<4} {row.value:.5f}  {ratio}")

# Rows and what they were come from (weights, database, seed, versions), for tables and for comparing runs.
write_rows(folder / "rows.json", run_header(model, None, **settings), rows)
print(f"wrote {folder / 'rows.json'}; unit: {rows[0].unit}, mean over {rows[0].n} shapes")
