"""One scan in, one CAD mesh out.

    python examples/01_fit_one_scan.py                 # the bundled sample scan
    python examples/01_fit_one_scan.py chair.ply out/  # your own: .ply .pcd .xyz .pts .npy .npz .obj .stl .off .glb

Uses the bundled networks and the bundled database of chairs, tables and cabinets.
"""

import sys
from pathlib import Path

import kpred

scan = Path(sys.argv[1]) if len(sys.argv) > 1 else kpred.sample_scan()
folder = Path(sys.argv[2]) if len(sys.argv) > 2 else Path("kpred-examples")
folder.mkdir(parents=True, exist_ok=True)

# The scan may lie anywhere, in any unit, at any yaw. The up axis is found if it is not given (y here, up="z" for many
# scanners), and so is the category; category="chair" gives it.
fit = kpred.fit(scan, up="y")

# The mesh is in the scan's own frame and units, so that it can be laid over the scan.
fit.mesh.export(folder / "fitted.obj")

print(f"scan       {scan.name}")
print(f"retrieved  {fit.source.model_id} ({fit.category}), the best of {len(fit.candidates)} candidates")
for metric in fit.metrics:
    print(f"{metric.name}  {metric.value:.4g} {metric.unit}, frame: {metric.frame}")
print(f"wrote      {folder / 'fitted.obj'} ({len(fit.mesh.vertices)} vertices, {len(fit.mesh.faces)} faces)")

# How far the model was changed (none, scale, structure), and what it lost of its right angles:
print(f"change     {fit.source.step}, right angles by {fit.cleanliness.squareness:.2f} degrees")

# The best candidates: error of each after its change, and the score they are compared by (lower is better).
for rank, candidate in enumerate(fit.candidates[:3]):
    print(f"  {candidate.model_id:<32} {candidate.step:<10} {candidate.error:.4f} {candidate.score:.2f}")
    fit.candidate(rank).export(folder / f"candidate_{rank}.obj")
