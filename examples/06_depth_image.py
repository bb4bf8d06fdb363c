"""One depth picture in, a CAD mesh out, in the world of the camera's pose and drawn over the photograph.

    python examples/06_depth_image.py [output folder]

The picture is rendered here; yours are 16-bit .png files in millimetres. From the command line:
kpred fit-depth depth.png --intrinsics camera.txt --pose pose.txt --mask mask.png --rgb photo.png -o chair.obj
"""

import sys
from pathlib import Path

import numpy as np
from PIL import Image

import kpred
from kpred.rendering.overlay import save_overlay
from kpred.shapes import Camera, read_depth, read_mask, scan_depth, write_depth
from kpred.shapes.render import render_faces
from kpred.synthetic.generator import generate

folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path("kpred-examples")
folder.mkdir(parents=True, exist_ok=True)

# 1. A camera: intrinsics in pixels, size of the picture, and its pose, camera (x right, y down, z forward) to world.
eye, target = np.array([1.3, 1.4, 1.9]), np.array([0.0, 0.4, 0.0])
forward = (target - eye) / np.linalg.norm(target - eye)
right = np.cross(forward, [0.0, 1.0, 0.0])
right /= np.linalg.norm(right)
pose = np.eye(4)
pose[:3] = np.column_stack([right, np.cross(forward, right), forward, eye])
camera = Camera(np.array([[300.0, 0, 160], [0, 300, 120], [0, 0, 1]]), 320, 240, pose)

# 2. What it saw: a chair on a floor. The mask says which pixels are the chair's.
chair = generate("chair", 5, seed=11, splits=False)[4]
floor = np.array([[-9.0, 0, -9], [9, 0, -9], [9, 0, 9], [-9, 0, 9]])
vertices = np.concatenate([chair.vertices, floor])
faces = np.concatenate([chair.faces, np.array([[0, 2, 1], [0, 3, 2]]) + len(chair.vertices)])
depth, face = render_faces(vertices, faces, camera)
write_depth(folder / "depth.png", depth)
Image.fromarray(((face >= 0) & (face < len(chair.faces))).astype(np.uint8)).save(folder / "mask.png")
brightness = (255 * np.exp(-0.25 * depth)).astype(np.uint8)
Image.fromarray(np.stack([brightness] * 3, axis=-1)).save(folder / "photo.png")

# 3. The chair's pixels as points in the world. Several pictures: kpred.shapes.merge_views([scan, ...]).
scan = scan_depth(read_depth(folder / "depth.png"), camera, read_mask(folder / "mask.png"))

# 4. The fit. One picture shows one side (partial); the result keeps out of what the camera looked through (sensor) and
#    stands on the floor, where its height is known.
fit = kpred.fit(scan.points, up="y", partial=True, sensor=scan.origin, floor=0.0)
fit.mesh.export(folder / "depth_fitted.obj")
save_overlay(fit.mesh.vertices, fit.mesh.faces, camera, folder / "photo.png", folder / "depth_overlay.png")

print(f"{len(scan.points)} points of one picture -> {fit.source.model_id} ({fit.category})")
print(f"probability that this is right: {fit.confidence:.2f}")
for sentence in fit.warnings:
    print(f"look at this: {sentence}")
for name, bounds in (("chair", chair.bounds), ("result", fit.mesh.bounds)):
    print(f"box of the {name}: {np.round(bounds[0], 2)} to {np.round(bounds[1], 2)} m")
print(f"wrote {folder / 'depth_fitted.obj'} and {folder / 'depth_overlay.png'}")
