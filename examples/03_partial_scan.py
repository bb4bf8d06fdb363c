"""A scan from one side: what the camera did not see is completed by the CAD model.

python examples/03_partial_scan.py [output folder]
"""

import sys
from pathlib import Path

import numpy as np
import torch

import kpred
from kpred.ops import depth_scan, sample_surface
from kpred.ops.nearest import nearest_neighbours
from kpred.synthetic.generator import generate

folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path("kpred-examples")
folder.mkdir(parents=True, exist_ok=True)

# A chair of 0.8 to 1 m, seen by a depth camera that stands two metres away, in front, to the side and above.
chair = generate("chair", 5, seed=11, splits=False)[4]
vertices, faces = torch.from_numpy(chair.vertices), torch.from_numpy(chair.faces).long()
generator = torch.Generator().manual_seed(0)
scan = depth_scan(vertices, faces, torch.tensor([1.2, 1.4, 1.6]), 4000, noise=0.003, generator=generator)
np.savetxt(folder / "partial_scan.xyz", scan.numpy(), fmt="%.4f")

# partial=True: networks for partial scans, and retrieval weighted by how densely each keypoint's region was seen. The
# model's own surface counts as far as it was likely seen. Without it kpred finds out whether parts are missing.
fit = kpred.fit(scan.numpy(), category="chair", partial=True)
fit.mesh.export(folder / "partial_fitted.obj")

print(f"seen of the result: {fit.seen:.0%}")
# How dense the scan is around each keypoint, 0 (unseen) to 1:
print("confidence of the keypoints:", fit.keypoint_confidence.round(2))
print(f"retrieved {fit.source.model_id}; wrote {folder / 'partial_fitted.obj'}")

# The chair is known here, so that the result can be compared with all of it, the unseen part too.
whole, _ = sample_surface(vertices, faces, 4000, generator)
result, _ = sample_surface(
    torch.tensor(np.asarray(fit.mesh.vertices), dtype=torch.float32),
    torch.tensor(np.asarray(fit.mesh.faces), dtype=torch.long),
    4000,
    generator,
)
for name, points in (("seen points", scan), ("whole chair", whole)):
    squared, _ = nearest_neighbours(points[None].float(), result[None])
    print(f"mean distance from the {name} to the result: {float(squared.sqrt().mean()) * 100:.1f} cm")
