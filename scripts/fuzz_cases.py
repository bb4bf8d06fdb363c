"""Valid files of every kind that kpred reads, each with its reader; `fuzz_readers.py` mutates them."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from PIL import Image

from kpred.scenes.objects import objects_of
from kpred.scenes.scene import read_scene
from kpred.shapes.captures.capture import GL_TO_CV
from kpred.shapes.captures.read import capture_scan, read_capture
from kpred.shapes.depth import read_depth, read_mask
from kpred.shapes.intrinsics_file import read_intrinsics_file
from kpred.shapes.manifest import read_manifest
from kpred.shapes.mesh import Mesh
from kpred.shapes.mesh_io import read_mesh, write_mesh
from kpred.shapes.pack import MeshPack
from kpred.shapes.pose_file import read_pose
from kpred.shapes.scan import read_scan
from kpred.synthetic.generator import generate


@dataclass(frozen=True)
class Case:
    """A valid file and what reads it."""

    path: Path
    read: Callable[[Path], Any]


def cases(folder: Path) -> list[Case]:
    """Write one valid file of every kind into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    ball = trimesh.creation.icosphere(2, radius=0.4)
    mesh = Mesh(ball.vertices, ball.faces)
    found = []
    for extension in (".obj", ".ply", ".stl", ".off", ".glb"):
        write_mesh(folder / f"mesh{extension}", mesh)
        found += [Case(folder / f"mesh{extension}", read_scan), Case(folder / f"mesh{extension}", read_mesh)]
    (folder / "text.ply").write_text(_text_ply(mesh))
    (folder / "text.stl").write_text(trimesh.exchange.stl.export_stl_ascii(ball))
    content = trimesh.Scene(ball).export(file_type="gltf")
    for name, data in content.items():
        (folder / name).write_bytes(data)
    found += [Case(folder / name, read_mesh) for name in ("text.ply", "text.stl", "model.gltf")]
    clouds = _clouds(folder, np.asarray(ball.vertices))
    return [*found, *clouds, *_cameras(folder), *_scenes(folder, mesh), *_captures(folder)]


def _text_ply(mesh: Mesh) -> str:
    head = f"ply\nformat ascii 1.0\nelement vertex {len(mesh.vertices)}\n"
    head += "".join(f"property float {axis}\n" for axis in "xyz")
    head += f"element face {len(mesh.faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    rows = "".join(f"{x} {y} {z}\n" for x, y, z in mesh.vertices.tolist())
    return head + rows + "".join(f"3 {a} {b} {c}\n" for a, b, c in mesh.faces.tolist())


def _clouds(folder: Path, points: np.ndarray) -> list[Case]:
    lines = [" ".join(map(str, row)) for row in points.tolist()]
    (folder / "a.xyz").write_text("\n".join(lines))
    (folder / "a.csv").write_text("id,x,y,z\n" + "\n".join(f"{i},{','.join(r.split())}" for i, r in enumerate(lines)))
    (folder / "a.pts").write_text(f"{len(lines)}\n" + "\n".join(lines))
    (folder / "comma.txt").write_text("\n".join(lines).replace(".", ","))
    np.save(folder / "a.npy", points)
    np.save(folder / "columns.npy", np.asfortranarray(points))
    np.savez_compressed(folder / "a.npz", points=points)
    header = "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n"
    header += f"WIDTH {len(points)}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {len(points)}\n"
    raw = points.astype("<f4").T.tobytes()
    packed = b"".join(bytes([len(raw[at : at + 32]) - 1]) + raw[at : at + 32] for at in range(0, len(raw), 32))
    (folder / "ascii.pcd").write_text(f"{header}DATA ascii\n" + "\n".join(lines))
    (folder / "binary.pcd").write_bytes(f"{header}DATA binary\n".encode() + points.astype("<f4").tobytes())
    sizes = np.array([len(packed), len(raw)], "<u4").tobytes()
    (folder / "packed.pcd").write_bytes(f"{header}DATA binary_compressed\n".encode() + sizes + packed)
    np.savez(folder / "axes.npz", x=points[:, 0], y=points[:, 1], z=points[:, 2])
    (folder / "tuples.txt").write_text("\n".join(str(tuple(row)) for row in points.tolist()))
    matrix = "\n".join(" ".join(map(str, row)) for row in np.eye(4).tolist())
    (folder / "a.ptx").write_text(f"{len(lines)}\n1\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n{matrix}\n" + "\n".join(lines))
    (folder / "a.las").write_bytes(_las(points))
    names = ["a.xyz", "a.csv", "a.pts", "comma.txt", "a.npy", "columns.npy", "a.npz", "axes.npz", "tuples.txt"]
    names += ["a.ptx", "a.las"]
    return [Case(folder / name, read_scan) for name in (*names, "ascii.pcd", "binary.pcd", "packed.pcd")]


def _las(points: np.ndarray) -> bytes:
    """Make a LAS file 1.2 of points in steps of a tenth of a millimetre."""
    records = np.zeros((len(points), 20), np.uint8)
    records[:, :12] = (points / 1e-4).round().astype("<i4").view(np.uint8)
    header = bytearray(227)
    header[:4], header[24:26] = b"LASF", bytes([1, 2])
    struct.pack_into("<HIIBHI", header, 94, 227, 227, 0, 0, 20, len(points))
    struct.pack_into("<6d", header, 131, 1e-4, 1e-4, 1e-4, 0, 0, 0)
    return bytes(header) + records.tobytes()


def _cameras(folder: Path) -> list[Case]:
    numbers = {"fx": 290.0, "fy": 290.0, "ppx": 159.5, "ppy": 119.5, "width": 320, "height": 240, "depth_scale": 0.001}
    (folder / "k.json").write_text(json.dumps(numbers))
    (folder / "k.txt").write_text("290 0 159.5\n0 290 119.5\n0 0 1\n")
    (folder / "keyed.txt").write_text("".join(f"{key} = {value}\n" for key, value in numbers.items()))
    (folder / "k.yaml").write_text(
        "image_width: 320\nimage_height: 240\ncamera_matrix:\n  data: [290, 0, 160, 0, 290, 120, 0, 0, 1]\n"
    )
    np.save(folder / "k.npy", np.array([[290.0, 0, 160], [0, 290, 120], [0, 0, 1]]))
    (folder / "pose.json").write_text(json.dumps({"transform_matrix": np.eye(4).tolist()}))
    (folder / "pose.txt").write_text("\n".join(" ".join(map(str, row)) for row in np.eye(4)))
    depth = np.full((24, 32), 1000, np.uint16)
    Image.fromarray(depth).save(folder / "depth.png")
    Image.fromarray(depth).save(folder / "depth.tiff")
    np.save(folder / "depth.npy", depth)
    np.savez(folder / "depth.npz", depth=depth)
    np.savez(folder / "k.npz", K=np.array([[290.0, 0, 160], [0, 290, 120], [0, 0, 1]]))
    Image.fromarray(depth).save(folder / "depth.pgm")
    (folder / "depth.pfm").write_bytes(b"Pf\n32 24\n-1.0\n" + (depth / 1000).astype("<f4").tobytes())
    Image.fromarray((depth > 0).astype(np.uint8)).save(folder / "mask.png")
    found = [
        Case(folder / name, read_intrinsics_file)
        for name in ("k.json", "k.txt", "keyed.txt", "k.yaml", "k.npy", "k.npz")
    ]
    found += [Case(folder / name, read_pose) for name in ("pose.json", "pose.txt")]
    found += [Case(folder / name, read_depth) for name in ("depth.png", "depth.tiff", "depth.npy", "depth.npz")]
    found += [Case(folder / name, read_depth) for name in ("depth.pgm", "depth.pfm")]
    return [*found, Case(folder / "mask.png", read_mask)]


def _captures(folder: Path) -> list[Case]:
    """Write folders of depth pictures, and return what reads them when one of their files is mutated."""
    turned = np.eye(4) @ GL_TO_CV
    camera = {"fl_x": 20.0, "fl_y": 20.0, "cx": 15.5, "cy": 11.5, "w": 32, "h": 24}
    frames = [
        {"file_path": f"{view}.png", "depth_file_path": f"depth/{view}.png", "transform_matrix": turned.tolist()}
        for view in range(2)
    ]
    row = "0 0 0 0 0 0 1"
    files = {
        "nerf/transforms.json": json.dumps(camera | {"frames": frames}),
        "stray/odometry.csv": "t, frame, x, y, z, qx, qy, qz, qw\n"
        + "".join(f"0.1, {view}, {row.replace(' ', ', ')}\n" for view in range(2)),
        "stray/camera_matrix.csv": "20,0,15.5\n0,20,11.5\n0,0,1\n",
        "tum/groundtruth.txt": "".join(f"{view}.0 {row}\n" for view in range(2)),
        "tum/depth.txt": "".join(f"{view}.0 depth/{view}.png\n" for view in range(2)),
        "tum/camera.txt": "20 20 15.5 11.5",
        "replica/traj.txt": "".join(" ".join(map(str, np.eye(4).ravel())) + "\n" for _ in range(2)),
        "replica/cam_params.json": json.dumps({"fx": 20.0, "fy": 20.0, "cx": 15.5, "cy": 11.5, "w": 32, "h": 24}),
        "r3d/metadata.json": json.dumps({"w": 32, "h": 24, "K": [20, 0, 0, 0, 20, 0, 15.5, 11.5, 1], "poses": _TURNS}),
        "o3d/a.log": "".join(
            f"{view} {view} {view + 1}\n" + "1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n" for view in range(2)
        ),
        "o3d/intrinsic.json": json.dumps(
            {"width": 32, "height": 24, "intrinsic_matrix": [20, 0, 0, 0, 20, 0, 15.5, 11.5, 1]}
        ),
    }
    for name, text in files.items():
        file = folder / name
        (file.parent / "depth").mkdir(parents=True, exist_ok=True)
        file.write_text(text)
        for view in range(2):
            Image.fromarray(np.full((24, 32), 1000 + view, np.uint16)).save(file.parent / f"depth/{view}.png")
    return [Case(folder / name, lambda file: capture_scan(read_capture(file.parent))) for name in files]


_TURNS = [[0, 0, 0, 1, 0, 0, 0]] * 2


def _scenes(folder: Path, mesh: Mesh) -> list[Case]:
    scene = read_scene(folder / "mesh.ply")
    count = len(mesh.vertices)
    instances = np.arange(count) // 60 + 1
    np.save(folder / "instances.npy", instances)
    np.savez(folder / "instances.npz", instances=instances)
    (folder / "instances.txt").write_text("\n".join(map(str, instances)))
    (folder / "s.segs.json").write_text(json.dumps({"segIndices": instances.tolist()}))
    groups = [{"objectId": 1, "label": "chair", "segments": [1, 2]}]
    contents = {
        "boxes.json": [
            {"center": [0, 0, 0], "size": [1, 1, 1], "yaw": 0.5, "category": "chair"},
            [[0, 0, 0], [1, 1, 1]],
        ],
        "groups.json": {"segmentsFile": "s.segs.json", "segGroups": groups},
        "arkit.json": {"data": [{"label": "chair", "segments": {"obb": _obb()}}]},
        "cad.json": [{"id_scan": "mesh", "trs": _trs(), "aligned_models": [{"trs": _trs(), **_cad()}]}],
    }
    for name, content in contents.items():
        (folder / name).write_text(json.dumps(content))
    generate("table", 2, seed=1, splits=False).save(folder / "pack.npz")
    names = ["instances.npy", "instances.npz", "instances.txt", *contents]
    found = [Case(folder / name, lambda file: objects_of(scene, file)) for name in names]
    found += [Case(folder / "mesh.ply", read_scene), Case(folder / "pack.npz", MeshPack.load)]
    try:
        import pyarrow
        from pyarrow import parquet

        parquet.write_table(
            pyarrow.table({"path": ["a.ply"], "id": ["a"], "category": ["chair"]}), folder / "m.parquet"
        )
        found.append(Case(folder / "m.parquet", lambda file: list(read_manifest(file))))
    except ImportError:
        pass
    return found


def _obb() -> dict[str, Any]:
    return {"centroid": [0, 0, 0], "axesLengths": [1, 1, 1], "normalizedAxes": np.eye(3).ravel().tolist()}


def _trs() -> dict[str, Any]:
    return {"translation": [0, 0, 0], "rotation": [1, 0, 0, 0], "scale": [1, 1, 1]}


def _cad() -> dict[str, Any]:
    return {"catid_cad": "03001627", "id_cad": "a1", "bbox": [0.3, 0.4, 0.3], "center": [0, 0, 0], "sym": "__SYM_NONE"}
