"""Pack the Blender add-on of `integrations/blender` as an extension: dist/kpred_fit-<version>.zip."""

from __future__ import annotations

import sys
import tomllib
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "integrations" / "blender"
FILES = ("blender_manifest.toml", "__init__.py")
NEVER_CHANGES = (2026, 1, 1, 0, 0, 0)
"""Time of the files in the ZIP: the same sources give the same bytes."""


def make_addon(folder: Path) -> Path:
    """Write the ZIP into a folder, and return it."""
    manifest = tomllib.loads((FOLDER / "blender_manifest.toml").read_text(encoding="utf-8"))
    folder.mkdir(parents=True, exist_ok=True)
    target = folder / f"{manifest['id']}-{manifest['version']}.zip"
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in FILES:
            archive.writestr(zipfile.ZipInfo(name, NEVER_CHANGES), (FOLDER / name).read_bytes())
        archive.writestr(zipfile.ZipInfo("LICENSE", NEVER_CHANGES), (ROOT / "LICENSE").read_bytes())
    return target


if __name__ == "__main__":
    print(make_addon(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "dist"))
