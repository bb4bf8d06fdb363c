"""Files that a mesh file names (materials, textures): found beside it or below, and nowhere else, by no link."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from urllib.parse import unquote

from kpred.shapes.reading import leads_outside

MAX_BYTES = 1 << 26
"""Larger files are left out."""


def find_companion(mesh: Path, names: Iterable[str]) -> tuple[str, bytes] | None:
    """Read the first of these names that is a file in the folder of the mesh, or below; None where none is."""
    for name in names:
        plain = unquote(name).replace("\\", "/").strip().strip('"')
        relative = Path(plain)
        if not plain or relative.is_absolute() or ".." in relative.parts or "\0" in plain or len(plain) > 1000:
            continue
        # Absolute paths of another machine often end in the name of a file that is here.
        for file in (mesh.parent / relative, mesh.parent / relative.name):
            try:
                if file.is_file() and file.stat().st_size <= MAX_BYTES and not leads_outside(file, mesh):
                    return relative.name, file.read_bytes()
            except OSError:
                continue
    return None
