"""Files that a mesh file names (materials, textures): found beside it or below, and nowhere else, by no link."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from pathlib import Path
from urllib.parse import unquote

from kpred.shapes.reading import leads_outside

MAX_BYTES = 1 << 27
"""Larger files are left out, with a warning; a picture of 8192 x 8192 pixels takes some 60 MB."""


def find_companion(mesh: Path, names: Iterable[str], max_bytes: int = MAX_BYTES) -> tuple[str, bytes] | None:
    """Read the first of these names that is a file in the folder of the mesh, or below; None where none is."""
    for name in names:
        plain = unquote(name).replace("\\", "/").strip().strip('"')
        relative = Path(plain)
        if not plain or relative.is_absolute() or ".." in relative.parts or "\0" in plain or len(plain) > 1000:
            continue
        # Absolute paths of another machine often end in the name of a file that is here.
        for file in (mesh.parent / relative, mesh.parent / relative.name):
            try:
                if not file.is_file() or leads_outside(file, mesh):
                    continue
                if file.stat().st_size <= max_bytes:
                    return relative.name, file.read_bytes()
                size = file.stat().st_size / 1e6
                warnings.warn(f"{mesh}: its {relative.name} of {size:.0f} MB is too large and left out.", stacklevel=2)
            except OSError:
                continue
    return None
