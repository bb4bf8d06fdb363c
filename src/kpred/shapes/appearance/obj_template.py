"""An OBJ file as a template: lines of `v` and `vn` are filled in anew, every other line stays."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from kpred.shapes.appearance.companions import find_companion
from kpred.shapes.appearance.normals import Corners, deform_directions

_MAP = re.compile(
    r"^(\s*(?:map_\w+|bump|disp|refl|decal|norm)\s+)((?:-\w+\s+(?:[-\d.]+\s+|on\s+|off\s+)*)*)(.+?)\s*$", re.I
)


def read_obj_template(path: Path) -> tuple[dict[str, bytes], int]:
    """Read an OBJ file without its positions, with its materials and textures.

    Returns:
        Files by name (`model.obj`, `model.mtl`, textures) and the number of `v` lines; no files where the OBJ has
        nothing but positions and faces.
    """
    text = path.read_bytes().replace(b"\r\n", b"\n").replace(b"\\\n", b" ").decode("utf-8", "surrogateescape")
    lines: list[str] = []
    materials: list[str] = []
    textures: dict[str, bytes] = {}
    count = 0
    for raw in text.split("\n"):
        line = raw.strip()
        key, rest = (line.split(None, 1) + ["", ""])[:2]
        if key in ("v", "vn", "vt", "f"):
            rest = rest.partition("#")[0].strip()
        if key == "v":
            count += 1
            lines.append(" ".join(["v", *rest.split()[3:]]))  # what may follow is a weight or a color
        elif key == "mtllib":
            found = find_companion(path, [rest, *rest.split()])
            if found is not None and not materials:
                lines.append("mtllib model.mtl")
            if found is not None:
                materials += _materials(path, found[1].decode("utf-8", "surrogateescape"), textures)
        else:
            lines.append(line if key.startswith("#") else f"{key} {rest}".rstrip())
    keys = {line.partition(" ")[0] for line in lines}
    names = {line for line in lines if line.startswith(("o ", "g "))}
    if not keys & {"vt", "vn", "usemtl"} and len(names) < 2:
        return {}, count
    files = {"model.obj": "\n".join(lines).encode("utf-8", "surrogateescape")}
    if materials:
        files["model.mtl"] = "\n".join(materials).encode("utf-8", "surrogateescape")
    return files | textures, count


def write_obj_template(
    files: Mapping[str, bytes],
    source: np.ndarray,
    result: np.ndarray,
    rotation: np.ndarray,
    stem: str,
    digits: int,
    comments: tuple[str, ...] = (),
) -> dict[str, bytes]:
    """Fill in positions (n, 3) and normals; return files by name, `stem`.obj first, the others named after it.

    Args:
        source: positions that the file had, in the axes of the mesh; rotation: from the file's axes to those.
    """
    lines = files["model.obj"].decode("utf-8", "surrogateescape").split("\n")
    faces = [row for row, line in enumerate(lines) if line.startswith("f ")]
    normals = np.array([line.split()[1:4] for line in lines if line.startswith("vn ")], dtype=np.float64)
    corners, words = _corners(lines, faces, len(normals))
    written, rows = [], iter(result.tolist())
    moved = np.zeros((0, 3))
    if len(normals) and len(corners.at):
        pairs, owner = np.unique(np.stack([corners.at, corners.owner]), axis=1, return_inverse=True)
        shared = Corners(corners.before, corners.at, corners.after, owner.reshape(-1))
        moved = deform_directions(shared, source, result, normals[pairs[1]] @ rotation.T)
        moved, place = np.unique(np.round(moved, 5) + 0.0, axis=0, return_inverse=True)
        numbers = iter(place.reshape(-1)[owner.reshape(-1)].tolist())
        for row in faces:
            lines[row] = "f " + " ".join(
                f"{v}/{t}/{next(numbers) + 1}" if n else v + (f"/{t}" if t else "") for v, t, n in words[row]
            )
    has_normals = False
    for line in lines:
        if line == "v" or line.startswith("v "):
            x, y, z = next(rows)
            written.append(f"v {x:.{digits}g} {y:.{digits}g} {z:.{digits}g}{line[1:]}")
        elif line.startswith("vn ") and len(moved):
            if not has_normals:
                written += [f"vn {x:g} {y:g} {z:g}" for x, y, z in moved.tolist()]
            has_normals = True
        elif line == "mtllib model.mtl":
            written.append(f"mtllib {stem}.mtl")
        else:
            written.append(line)
    text = "\n".join([*(f"# {comment}" for comment in comments), *written])
    found = {f"{stem}.obj": text.encode("utf-8", "surrogateescape")}
    if "model.mtl" in files:
        found[f"{stem}.mtl"] = _renamed(files["model.mtl"], stem, files)
    for name, content in files.items():
        if name not in ("model.obj", "model.mtl"):
            found[f"{stem}_{name}"] = content
    return found


def strip_map_options(materials: bytes) -> bytes:
    """Leave out the options (scale, offset, ...) that stand before the names of textures."""
    lines = materials.decode("utf-8", "surrogateescape").split("\n")
    plain = [f"{named[1]}{named[3]}" if (named := _MAP.match(line)) else line for line in lines]
    return "\n".join(plain).encode("utf-8", "surrogateescape")


def _materials(path: Path, text: str, textures: dict[str, bytes]) -> list[str]:
    """Return the lines of a material file, with textures named as they are kept."""
    lines = []
    for line in text.replace("\r\n", "\n").split("\n"):
        named = _MAP.match(line)
        found = find_companion(path, [named[3], named[3].split()[-1]]) if named else None
        if named and found is not None:
            name = _free_name(found[0].replace(" ", "_"), found[1], textures)
            textures[name] = found[1]
            lines.append(f"{named[1]}{named[2]}{name}")
        else:
            lines.append(line)
    return lines


def _free_name(name: str, content: bytes, taken: Mapping[str, bytes]) -> str:
    number, found = 2, name
    while found in ("model.obj", "model.mtl") or taken.get(found, content) != content:
        found, number = f"{number}_{name}", number + 1
    return found


def _renamed(materials: bytes, stem: str, files: Mapping[str, bytes]) -> bytes:
    lines = []
    for line in materials.decode("utf-8", "surrogateescape").split("\n"):
        named = _MAP.match(line)
        lines.append(f"{named[1]}{named[2]}{stem}_{named[3]}" if named and named[3] in files else line)
    return "\n".join(lines).encode("utf-8", "surrogateescape")


def _corners(lines: list[str], faces: list[int], normals: int) -> tuple[Corners, dict[int, list[tuple[str, str, str]]]]:
    """List corners with a normal, and the words of every face; negative numbers count from where they stand."""
    vertices = seen_normals = 0
    before, at, after, owner = [], [], [], []
    words: dict[int, list[tuple[str, str, str]]] = {}
    wanted = set(faces)
    for row, line in enumerate(lines):
        if line == "v" or line.startswith("v "):
            vertices += 1
        elif line.startswith("vn "):
            seen_normals += 1
        elif row in wanted:
            parts = [(*word.split("/"), "", "")[:3] for word in line.split()[1:]]
            index = [int(v) - 1 if int(v) > 0 else vertices + int(v) for v, _, _ in parts]
            kept = []
            for number, (v, t, n) in enumerate(parts):
                normal = -1 if not n else (int(n) - 1 if int(n) > 0 else seen_normals + int(n))
                is_good = len(parts) > 2 and 0 <= normal < normals
                if is_good:
                    before.append(index[number - 1])
                    at.append(index[number])
                    after.append(index[(number + 1) % len(parts)])
                    owner.append(normal)
                kept.append((v, t, n if is_good else ""))
            words[row] = kept
    return Corners(*(np.array(values, dtype=np.int64) for values in (before, at, after, owner))), words
