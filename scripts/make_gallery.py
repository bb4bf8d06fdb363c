"""Run the examples, and keep what they print and small pictures of their results for the gallery of the site.

    python scripts/make_gallery.py [EXAMPLE ...]       # all of examples/ without names; writes docs/gallery/

An example's picture shows the overlay that it wrote, else its scene or its fitted mesh; examples without any have none.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import trimesh
from PIL import Image, ImageOps

from kpred.shapes import Camera
from kpred.shapes.render import render_faces

REPOSITORY = Path(__file__).resolve().parents[1]
GALLERY = REPOSITORY / "docs" / "gallery"
PICTURED = ("*_overlay.png", "scene.glb", "*fitted.obj", "*fitted.glb")
"""Patterns of results, the first that an example wrote is shown."""
SIZE, OVERSAMPLING, MARGIN, COLOURS = (480, 360), 3, 30, 48
EYE = (0.62, 0.48, 1.0)
"""Direction from the object to the camera, y up, front +z."""


def main(names: list[str]) -> None:
    """Run the named examples, or all of them."""
    GALLERY.mkdir(parents=True, exist_ok=True)
    for example in sorted((REPOSITORY / "examples").glob("*.py")):
        if not names or example.stem in names or example.name in names:
            run(example)


def run(example: Path) -> None:
    """Run one example in an empty folder and write its output (.txt) and picture (.png)."""
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run([sys.executable, str(example)], cwd=folder, capture_output=True, text=True, check=True)
        (GALLERY / f"{example.stem}.txt").write_text(done.stdout)
        found = [file for pattern in PICTURED for file in sorted(Path(folder).rglob(pattern))]
        if found:
            picture = Image.open(found[0]) if found[0].suffix == ".png" else _cropped(draw(found[0]))
            picture.thumbnail(SIZE)
            small = picture.convert("RGB").quantize(COLOURS)
            small.save(GALLERY / f"{example.stem}.png", optimize=True)
    print(f"{example.stem}: {', '.join(file.name for file in found[:1]) or 'no picture'}")


def draw(file: Path) -> Image.Image:
    """Draw a mesh file (y up) from the front, from above, shaded by its normals."""
    mesh = trimesh.load(file, force="mesh")
    vertices = np.asarray(mesh.vertices) - mesh.bounds.mean(axis=0)
    direction = np.array(EYE) / np.linalg.norm(EYE)
    width, height = (OVERSAMPLING * size for size in SIZE)
    focal = 1.6 * height
    camera = Camera(
        np.array([[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1]]),
        width,
        height,
        _looking_at_origin(direction * 1.75 * np.linalg.norm(np.ptp(vertices, axis=0))),
    )
    _, face = render_faces(vertices, np.asarray(mesh.faces), camera)
    corners = vertices[np.asarray(mesh.faces)]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    light = np.array([0.35, 0.9, 0.55]) / np.linalg.norm([0.35, 0.9, 0.55])
    brightness = 0.45 + 0.55 * np.abs(normals @ light)
    image = np.full((height, width, 3), 255, np.uint8)
    image[face >= 0] = (brightness[face[face >= 0], None] * (150, 185, 220)).astype(np.uint8)
    return Image.fromarray(image)


def _cropped(picture: Image.Image) -> Image.Image:
    left, top, right, bottom = ImageOps.invert(picture).getbbox() or (0, 0, *picture.size)
    return ImageOps.expand(picture.crop((left, top, right, bottom)), MARGIN, "white")


def _looking_at_origin(eye: np.ndarray) -> np.ndarray:
    forward = -eye / np.linalg.norm(eye)
    right = np.cross(forward, [0.0, 1.0, 0.0])
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3] = np.column_stack([right, np.cross(forward, right), forward, eye])
    return pose


if __name__ == "__main__":
    main(sys.argv[1:])
