"""A scanned room in, one GLB with a CAD model for each piece of furniture out.

    python examples/07_scene.py [output folder]

The room is made here; yours may be a ScanNet, S3DIS or any other .ply, its objects instance numbers, boxes, ScanNet
segments or Scan2CAD annotations. From the command line: kpred scene room.ply --objects boxes.json -o scene.glb
"""

import json
import sys
from pathlib import Path

import numpy as np
import torch
import trimesh

from kpred.fitting.fit_scene import fit_scene
from kpred.ops import sample_surface
from kpred.scenes.objects import objects_of
from kpred.scenes.scene import read_scene
from kpred.synthetic.generator import generate

folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path("kpred-examples")
folder.mkdir(parents=True, exist_ok=True)


def cloud(mesh: trimesh.Trimesh, count: int, yaw: float, place: tuple[float, float]) -> np.ndarray:
    """Points on a mesh that stands in the room, z up as in most scans of rooms."""
    vertices, faces = torch.as_tensor(np.array(mesh.vertices)).float(), torch.as_tensor(np.array(mesh.faces)).long()
    points = sample_surface(vertices, faces, count, torch.Generator().manual_seed(0))[0].numpy()
    turn = np.array([[np.cos(yaw), 0, np.sin(yaw)], [0, 1, 0], [-np.sin(yaw), 0, np.cos(yaw)]])
    return (points @ turn.T)[:, [0, 2, 1]] * [1, -1, 1] + [*place, 0]


# 1. The scan of a room: a floor, two chairs, a table of which only the top was scanned, and a plant.
chairs, tables = generate("chair", 6, seed=11, splits=False), generate("table", 3, seed=11, splits=False)
plant = generate("other", 1, seed=4, splits=False)
rng = np.random.default_rng(0)
table = cloud(tables[2], 6000, 0.4, (2.0, 2.0))
parts = {
    "floor": np.column_stack([rng.uniform(-1, 4, (8000, 2)), rng.normal(0, 0.005, 8000)]),
    "near chair": cloud(chairs[4], 3000, 1.0, (0.0, 0.0)),
    "far chair": cloud(chairs[5], 3000, -2.0, (0.3, 2.5)),
    "table": table[table[:, 2] > 0.7 * table[:, 2].max()],
    "plant": cloud(plant[0], 3000, 0.0, (3.0, 0.0)),
}
trimesh.PointCloud(np.concatenate(list(parts.values()))).export(folder / "room.ply")

# 2. Its objects, as boxes; what has a category that the model does not know is skipped and listed.
boxes = [
    {
        "name": name,
        "category": name.split()[-1],
        "center": ((points.min(axis=0) + points.max(axis=0)) / 2).tolist(),
        "size": (np.ptp(points, axis=0) + 0.02).tolist(),
    }
    for name, points in parts.items()
    if name != "floor"
]
(folder / "boxes.json").write_text(json.dumps(boxes))

# 3. Every object fitted. Furniture stands on the scene's floor, also where its feet were not scanned.
scene = read_scene(folder / "room.ply", up="z")
result = fit_scene(scene, objects_of(scene, folder / "boxes.json"))
result.to_glb(folder / "scene.glb")

print(f"floor: {'none' if result.floor is None else f'{result.floor.level:.3f} m, from the {result.floor.source}'}")
for item in result.fits:
    if item.fit is None:
        print(f"{item.object.name}: {item.error}")
        continue
    low, high = item.fit.mesh.bounds[:, 2]
    print(f"{item.object.name}: {item.fit.source.model_id}, from {low:.2f} to {high:.2f} m", end=" ")
    print(f"(scan: from {item.object.points[:, 2].min():.2f} m), confidence {item.fit.confidence:.2f}")
print(f"wrote {folder / 'scene.glb'}: y up, one named node for each object")
