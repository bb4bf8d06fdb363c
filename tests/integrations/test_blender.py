"""The Blender add-on: packed reproducibly, of this version, valid; in Blender it fits a cloud where it stands."""

import json
import os
import subprocess
import sys
import tomllib
import zipfile
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from kpred._version import __version__
from kpred.fitting import sample_scan
from kpred.shapes import read_scan

ROOT = Path(__file__).parents[2]
SESSION = Path(__file__).parent / "blender_session.py"
BLENDER = os.environ.get("KPRED_BLENDER_PYTHON") or (sys.executable if find_spec("bpy") else None)
"""A Python that has `bpy`."""


@pytest.fixture
def addon(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.syspath_prepend(str(ROOT / "scripts"))
    made: Path = import_module("make_blender_addon").make_addon(tmp_path / "dist")
    return made


def test_the_addon_is_of_this_version_and_packed_reproducibly(addon: Path) -> None:
    manifest = tomllib.loads((ROOT / "integrations/blender/blender_manifest.toml").read_text())
    assert manifest["version"] == __version__
    assert addon.name == f"kpred_fit-{__version__}.zip"
    assert zipfile.ZipFile(addon).namelist() == ["blender_manifest.toml", "__init__.py", "LICENSE"]
    before = addon.read_bytes()
    assert import_module("make_blender_addon").make_addon(addon.parent).read_bytes() == before


@pytest.mark.slow
@pytest.mark.skipif(BLENDER is None, reason="no bpy: CONTRIBUTING.md says how to run this")
@pytest.mark.parametrize("scale", [1.0, 0.01])
def test_a_cloud_is_fitted_where_it_stands(addon: Path, tmp_path: Path, scale: float) -> None:
    points = read_scan(sample_scan())
    # The sample is y up, Blender z up.
    np.save(tmp_path / "scan.npy", points[:, [2, 0, 1]])
    found = _session(addon, sys.executable, tmp_path, scale)
    assert found["result"] == ["FINISHED"]
    size = np.ptp(found["scan"], axis=0)
    assert size.max() * scale == pytest.approx(np.ptp(points, axis=0).max(), rel=0.01)
    assert np.abs(np.array(found["mesh"]) - found["scan"]).max() < 0.1 * size.max()
    assert found["root"] == "cloud fit" and found["materials"]
    assert found["properties"]["kpred_category"] == "chair"


@pytest.mark.skipif(BLENDER is None, reason="no bpy: CONTRIBUTING.md says how to run this")
def test_blender_takes_the_manifest(addon: Path) -> None:
    assert BLENDER is not None
    where = "import importlib.util as u; print(u.find_spec('bpy').submodule_search_locations[0])"
    folder = subprocess.run([BLENDER, "-c", where], capture_output=True, text=True, check=True).stdout.strip()
    validator = next(Path(folder).glob("*/scripts/addons_core/bl_pkg/cli/blender_ext.py"))
    done = subprocess.run([BLENDER, str(validator), "validate", str(addon)], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.slow
@pytest.mark.skipif(BLENDER is None, reason="no bpy: CONTRIBUTING.md says how to run this")
def test_what_goes_wrong_is_said_and_leaves_the_scene(addon: Path, tmp_path: Path) -> None:
    np.save(tmp_path / "scan.npy", np.zeros((100, 3)))
    with pytest.raises(subprocess.CalledProcessError) as failure:
        _session(addon, sys.executable, tmp_path, 1.0)
    assert "distinct points" in failure.value.stderr


def _session(addon: Path, interpreter: str, folder: Path, scale: float) -> dict[str, Any]:
    """Run Blender's side in a process and a user folder of its own."""
    home = folder / "blender"
    home.mkdir()
    environment = {**os.environ, "BLENDER_USER_RESOURCES": str(home), "HOME": str(home)}
    assert BLENDER is not None
    command = [BLENDER, str(SESSION), str(addon), interpreter, str(folder / "scan.npy"), str(scale)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True, timeout=900)
    found: dict[str, Any] = json.loads(done.stdout.strip().splitlines()[-1])
    return found
