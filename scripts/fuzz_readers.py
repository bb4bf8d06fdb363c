"""Mutate valid files and read them: every reader must raise errors of the package alone, quickly and in little memory.

    python scripts/fuzz_readers.py --inputs 100000 --seed 0

Prints one line a finding (seed, index, file, what happened) and keeps the input in `--keep`; exit code 1 if there is
one. Input number i of a seed is always the same.
"""

from __future__ import annotations

import argparse
import json
import resource
import signal
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np
import trimesh
from PIL import Image

from kpred.errors import KpredError
from kpred.scenes.objects import objects_of
from kpred.scenes.scene import read_scene
from kpred.shapes.depth import read_depth, read_mask
from kpred.shapes.intrinsics_file import read_intrinsics_file
from kpred.shapes.manifest import read_manifest
from kpred.shapes.mesh import Mesh
from kpred.shapes.mesh_io import read_mesh, write_mesh
from kpred.shapes.pack import MeshPack
from kpred.shapes.pose_file import read_pose
from kpred.shapes.scan import read_scan
from kpred.synthetic.generator import generate

SECONDS = 10.0
"""Time of one input beyond which it counts as a hang."""

MEGABYTES = 1000
"""Growth of the largest memory of the process beyond which an input counts as a bomb."""

_NUMBERS = [
    b"-1",
    b"0",
    b"nan",
    b"inf",
    b"1e400",
    b"-1e308",
    b"2147483648",
    b"18446744073709551616",
    b"9" * 60,
    b"1e-320",
]
_WORDS = [b"\x00", b"\xff\xfe", b"\xef\xbb\xbf", b"\r", b"\n", b'"', b",", b";", b"{", b"[" * 40, b"#", b"../", b"%2e"]


@dataclass(frozen=True)
class Case:
    """A valid file and what reads it."""

    path: Path
    read: Callable[[Path], Any]


@dataclass(frozen=True)
class Finding:
    """An input that did what none may do."""

    index: int
    case: Path
    what: str


class _Hang(BaseException):
    """Raised by the alarm; no reader catches it."""


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
    return [*found, *_clouds(folder, np.asarray(ball.vertices)), *_cameras(folder), *_scenes(folder, mesh)]


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
    names = ["a.xyz", "a.csv", "a.pts", "comma.txt", "a.npy", "columns.npy", "a.npz"]
    return [Case(folder / name, read_scan) for name in (*names, "ascii.pcd", "binary.pcd", "packed.pcd")]


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
    Image.fromarray((depth > 0).astype(np.uint8)).save(folder / "mask.png")
    found = [Case(folder / name, read_intrinsics_file) for name in ("k.json", "k.txt", "keyed.txt", "k.yaml", "k.npy")]
    found += [Case(folder / name, read_pose) for name in ("pose.json", "pose.txt")]
    found += [Case(folder / name, read_depth) for name in ("depth.png", "depth.tiff", "depth.npy")]
    return [*found, Case(folder / "mask.png", read_mask)]


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


def mutated(data: bytes, generator: np.random.Generator) -> bytes:
    """Change a file in one to four places: bytes, numbers, words, cuts, repeats; half of them in its beginning."""
    result = bytearray(data)
    for _ in range(int(generator.integers(1, 5))):
        if not result:
            break
        reach = len(result) if generator.random() < 0.5 else min(len(result), 400)
        at = int(generator.integers(reach))
        kind = int(generator.integers(8))
        if kind == 0:
            result[at] = int(generator.integers(256))
        elif kind == 1:
            result[at] ^= 1 << int(generator.integers(8))
        elif kind == 2:
            del result[at:]
        elif kind == 3:
            del result[at : at + int(generator.integers(1, 64))]
        elif kind == 4:
            result[at:at] = result[at : at + int(generator.integers(1, 64))]
        elif kind == 5:
            word = _WORDS[int(generator.integers(len(_WORDS)))]
            result[at : at + (len(word) if generator.random() < 0.5 else 0)] = word
        elif kind == 6:
            _replace_number(result, at, _NUMBERS[int(generator.integers(len(_NUMBERS)))])
        else:
            length = int(generator.choice([1, 2, 4, 8]))
            result[at : at + length] = bytes([int(generator.choice([0, 0x7F, 0x80, 0xFF]))]) * length
    return bytes(result)


def _replace_number(data: bytearray, at: int, number: bytes) -> None:
    """Replace the first number of text at or behind a place."""
    digits = b"0123456789.-+e"
    start = next((i for i in range(at, min(at + 200, len(data))) if data[i] in b"0123456789"), None)
    if start is not None:
        end = start
        while end < len(data) and data[end] in digits:
            end += 1
        data[start:end] = number


def fuzz(inputs: int, seed: int, folder: Path, keep: Path | None = None) -> Iterator[Finding]:
    """Read mutated files and yield what may not happen: foreign exceptions, hangs, bombs of memory.

    Args:
        inputs: how many files are tried.
        folder: for the files, made anew.
        keep: where inputs with findings are copied.
    """
    known = cases(folder)
    valid = {case.path: case.path.read_bytes() for case in known}
    for case in known:
        case.read(case.path)
    signal.signal(signal.SIGALRM, _alarm)
    for index in range(inputs):
        generator = np.random.default_rng([seed, index])
        case = known[int(generator.integers(len(known)))]
        data = mutated(valid[case.path], generator)
        case.path.write_bytes(data)
        what = _tried(case)
        case.path.write_bytes(valid[case.path])
        if what is not None:
            if keep is not None:
                keep.mkdir(parents=True, exist_ok=True)
                (keep / f"{seed}-{index}-{case.path.name}").write_bytes(data)
            yield Finding(index, case.path, what)


def _tried(case: Case) -> str | None:
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    signal.setitimer(signal.ITIMER_REAL, SECONDS)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            case.read(case.path)
    except KpredError as error:
        if "\n" in str(error):
            return f"a sentence of several lines: {error}"
    except _Hang:
        return f"longer than {SECONDS:g} s"
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
    grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
    return f"{grown:.0f} MB of memory" if grown > MEGABYTES else None


def _alarm(_number: int, _frame: FrameType | None) -> None:
    raise _Hang


def main() -> int:
    """Fuzz, print the findings, return 1 if there are any."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--inputs", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--keep", type=Path, default=Path("fuzz-findings"))
    given = parser.parse_args()
    started, count = time.monotonic(), 0
    with tempfile.TemporaryDirectory(prefix="kpred-fuzz-") as folder:
        for finding in fuzz(given.inputs, given.seed, Path(folder) / "cases", given.keep):
            count += 1
            print(f"{given.seed} {finding.index} {finding.case.name}: {finding.what[:300]}", flush=True)
    print(f"{given.inputs} inputs, {count} findings, {time.monotonic() - started:.0f} s")
    return 1 if count else 0


if __name__ == "__main__":
    sys.exit(main())
