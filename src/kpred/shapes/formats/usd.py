"""Positions, faces and parts of USD files (.usd .usda .usdc .usdz), as RoomPlan, Polycam and Blender write them."""

from __future__ import annotations

import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from kpred.errors import MeshError
from kpred.shapes.formats.geometry import Geometry
from kpred.shapes.formats.polygon import triangulate
from kpred.shapes.formats.usd_process import MEMORY_EXIT

USD_EXTENSIONS = (".usd", ".usda", ".usdc", ".usdz")

SECONDS, _BYTES_A_SECOND = 9.0, 200_000
"""Time that reading may take, and bytes of the file for each further second."""


def read_usd(path: Path, seconds: float = SECONDS) -> Geometry:
    """Read vertices, faces and parts of the visible meshes, solids and points of a USD file, in its world.

    A part is one prim, or one instance of it. References are followed within the file's folder. Up axis and unit of the
    file are left as they are. Small files are given up after `seconds`.

    Raises:
        MeshError: usd-core is not installed, or the file is damaged, refers to others outside, or is too large.
    """
    return _geometry(_found(path, seconds))


def read_usd_up(path: Path) -> tuple[Geometry, str]:
    """Read a USD file like `read_usd`, and the up axis that it names (y or z)."""
    found = _found(path)
    return _geometry(found), "z" if str(found["up"]).lower() == "z" else "y"


def _found(path: Path, seconds: float = SECONDS) -> dict[str, np.ndarray]:
    """Return the arrays of a file, or raise what is wrong with it."""
    if find_spec("pxr") is None:
        raise MeshError(f"{path}: USD needs usd-core: pip install 'kpred[usd]', or save it as .glb or .obj.")
    with TemporaryDirectory(prefix="kpred-") as folder:
        out = Path(folder) / "found.npz"
        found = _read(path, out, seconds)
        if "problem" in found:
            raise MeshError(f"{path}: {found['problem']}.")
    return found


def _geometry(found: dict[str, np.ndarray]) -> Geometry:
    vertices, parts = found["vertices"], found["parts"]
    faces, polygon = triangulate(vertices, found["corners"], found["sizes"])
    return Geometry(vertices, faces, parts.astype(np.int64)[polygon])


def _read(path: Path, out: Path, seconds: float) -> dict[str, np.ndarray]:
    """Run the process that reads; return its arrays."""
    script = Path(__file__).with_name("usd_process.py")
    command = [sys.executable, "-P", str(script), str(path.absolute()), str(out)]
    # One thread: composition of several would hold more memory than the file needs.
    seconds += path.stat().st_size / _BYTES_A_SECOND
    environment = os.environ | {"PXR_WORK_THREAD_LIMIT": "1", "OMP_NUM_THREADS": "1"}
    try:
        code = subprocess.run(
            command, stdin=subprocess.DEVNULL, capture_output=True, timeout=seconds, env=environment
        ).returncode
    except subprocess.TimeoutExpired as error:
        raise MeshError(f"{path}: it took more than {seconds:.0f} s to read; export a simpler file.") from error
    if code == MEMORY_EXIT:
        raise MeshError(f"{path}: it would take too much memory to read; export a simpler file.")
    if code != 0 or not out.exists():
        raise MeshError(f"{path}: it is not a readable USD file (damaged or cut short); export it again.")
    with np.load(out, allow_pickle=False) as arrays:
        return {name: arrays[name] for name in arrays.files}
