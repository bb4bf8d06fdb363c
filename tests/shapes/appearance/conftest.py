"""A chair of six named boxes with two materials, one of them textured, as OBJ and as GLB."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

PARTS = {
    "seat": ([0.5, 0.05, 0.5], [0, 0.45, 0], "fabric"),
    "back": ([0.5, 0.5, 0.05], [0, 0.7, -0.225], "fabric"),
    "leg.1": ([0.05, 0.45, 0.05], [-0.2, 0.2, -0.2], "oak wood"),
    "leg.2": ([0.05, 0.45, 0.05], [0.2, 0.2, -0.2], "oak wood"),
    "leg.3": ([0.05, 0.45, 0.05], [-0.2, 0.2, 0.2], "oak wood"),
    "leg.4": ([0.05, 0.45, 0.05], [0.2, 0.2, 0.2], "oak wood"),
}


def texture() -> bytes:
    stream = io.BytesIO()
    Image.fromarray(np.arange(48, dtype=np.uint8).reshape(4, 4, 3)).save(stream, "PNG")
    return stream.getvalue()


@pytest.fixture
def textured_obj(tmp_path) -> Path:
    folder = tmp_path / "textured"
    folder.mkdir()
    (folder / "oak board.png").write_bytes(texture())
    materials = "newmtl oak wood\nKd 0.6 0.4 0.2\nmap_Kd -s 1 1 1 oak board.png\n\nnewmtl fabric\nKd 0 0 1\nd 0.9\n"
    (folder / "chair.mtl").write_text(materials)
    lines = ["# by Ann Lee", "mtllib chair.mtl", "vt 0 0", "vt 1 0", "vt 1 1", "vt 0 1"]
    lines += [
        f"vn {sign if axis == 0 else 0} {sign if axis == 1 else 0} {sign if axis == 2 else 0}"
        for axis in range(3)
        for sign in (-1, 1)
    ]
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    for number, (name, (size, middle, material)) in enumerate(PARTS.items()):
        lines += [f"o {name}", f"usemtl {material}", "s off"]
        for corner in range(8):
            signs = np.array([corner >> 2 & 1, corner >> 1 & 1, corner & 1]) - 0.5
            lines.append("v " + " ".join(f"{x:.6g}" for x in np.array(middle) + signs * size))
        for face, quad in enumerate(quads):
            lines.append("f " + " ".join(f"{8 * number + v + 1}/{t + 1}/{face + 1}" for t, v in enumerate(quad)))
    file = folder / "chair.obj"
    file.write_text("\n".join(lines) + "\n")
    return file


@pytest.fixture
def textured_glb(tmp_path) -> Path:
    image = Image.open(io.BytesIO(texture()))
    materials = {
        "oak wood": trimesh.visual.material.PBRMaterial(name="oak wood", baseColorTexture=image, roughnessFactor=0.7),
        "fabric": trimesh.visual.material.PBRMaterial(name="fabric", baseColorFactor=[0, 0, 255, 255]),
    }
    scene = trimesh.Scene()
    frame = trimesh.transformations.rotation_matrix(0.4, [0, 1, 0])
    frame[:3, 3] = [0, 0.1, 0]
    scene.graph.update("frame", scene.graph.base_frame, matrix=frame)
    for name, (size, middle, material) in PARTS.items():
        mesh = trimesh.creation.box(size)
        mesh.unmerge_vertices()
        mesh.vertex_normals  # noqa: B018 (they are written)
        uv = np.random.default_rng(len(name)).random((len(mesh.vertices), 2))
        mesh.visual = trimesh.visual.TextureVisuals(uv=uv, material=materials[material])
        place = np.diag([2.0, 1.0, 1.0, 1.0])
        place[:3, 3] = middle
        scene.add_geometry(mesh, node_name=name, geom_name=f"mesh {name}", parent_node_name="frame", transform=place)
    file = tmp_path / "chair.glb"
    file.write_bytes(scene.export(file_type="glb", include_normals=True))
    return file
