"""Fit with CAD models of your own: a folder of meshes becomes a database, and the result is one of them, deformed.

    python examples/02_your_own_database.py [output folder]

The folder of meshes is generated here; put your own .obj .glb .gltf .ply .stl .off files in its place (y up, front +z).
"""

import sys
from pathlib import Path

import torch

import kpred
from kpred.database import build_database
from kpred.ops import sample_surface
from kpred.shapes import open_shapes
from kpred.synthetic.generator import generate

folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path("kpred-examples")
meshes = folder / "my_tables"
meshes.mkdir(parents=True, exist_ok=True)

# 1. A folder of mesh files: sixteen tables.
for mesh in generate("table", 16, seed=7, splits=False):
    kpred.write_mesh(meshes / f"{mesh.name}.obj", mesh)

# 2. Its database. Points, keypoints, retrieval tokens and deformation bases are computed once for each mesh; a build
#    that was stopped goes on where it was, and models that are there already are skipped.
model = kpred.load_model()
path = folder / "my_tables.kpred"
report = build_database(path, open_shapes(meshes, category="table"), model)
print(f"{path}: {report.added} added, {report.skipped_present} already there, {len(report.failed)} left out")

# 3. A scan: points on a table that is not among them, in centimetres and somewhere else in the room.
wanted = generate("table", 6, seed=8, splits=False)[5]
points, _ = sample_surface(
    torch.from_numpy(wanted.vertices), torch.from_numpy(wanted.faces).long(), 4000, torch.Generator().manual_seed(0)
)
scan = points.numpy() * 100 + [250, 0, -80]

# 4. The fit. deform="none" or "scale" would change the model less, and model_id="..." would take one that you name.
with kpred.Database.open(path) as database:
    fit = kpred.fit(scan, model=model, database=database, category="table", unit="cm")
    result = folder / "my_table_fitted.glb"
    fit.save(result)  # in metres, y up; .obj, .ply and .stl keep the scan's own frame and unit
print(f"retrieved {fit.source.model_id}, change: {fit.source.step}; wrote {result}")
for sentence in fit.warnings:
    print(f"look at this: {sentence}")
print(f"box of the scan:   {scan.min(axis=0).round(1)} to {scan.max(axis=0).round(1)} cm")
print(f"box of the result: {fit.mesh.bounds[0].round(1)} to {fit.mesh.bounds[1].round(1)} cm")
