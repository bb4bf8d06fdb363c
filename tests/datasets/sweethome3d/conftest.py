"""Small furniture libraries of Sweet Home 3D, written for tests."""

from __future__ import annotations

import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path

import pytest

OBJ = """mtllib thing.mtl
o body
usemtl wood
v 0 0 0
v 10 0 0
v 10 20 0
v 0 20 5
vt 0 0
vt 1 0
vt 1 1
vn 0 0 1
f 1/1/1 2/2/1 3/3/1
f 1/1/1 3/3/1 4/1/1
"""
MTL = "newmtl wood\nKd 0.5 0.3 0.1\nmap_Kd oak.png\n"


@pytest.fixture
def write_library() -> Callable[..., Path]:
    return _write_library


def _write_library(
    path: Path, models: Mapping[str, Mapping[str, str]], licence: str = "Creative Commons Attribution 3.0 license"
) -> Path:
    """Write a .sh3f; `models`: name -> properties, and `LICENSE` for a licence text in the model's folder."""
    lines = ["id=Test#Lib", "name=Test", f"license={licence}", "version=1"]
    with zipfile.ZipFile(path, "w") as archive:
        for number, (name, facts) in enumerate(models.items(), 1):
            known = {"name": "Chair", "tags": "", "category": "Office", "creator": "Ann", "width": "40", "depth": "10"}
            entry = {**known, "height": "80", "model": f"/lib/{name}/thing.obj", "id": f"Test#{name}", **facts}
            lines += [f"{key}#{number}={value}" for key, value in entry.items() if key != "LICENSE"]
            archive.writestr(f"lib/{name}/thing.obj", entry.get("OBJ", OBJ))
            archive.writestr(f"lib/{name}/thing.mtl", MTL)
            archive.writestr(f"lib/{name}/oak.png", b"not looked at")
            if "LICENSE" in facts:
                archive.writestr(f"lib/{name}/LICENSE.txt", facts["LICENSE"])
        archive.writestr("PluginFurnitureCatalog.properties", "\n".join(lines).encode("iso-8859-1"))
        archive.writestr("LICENSE.TXT", "the licence")
    return path
