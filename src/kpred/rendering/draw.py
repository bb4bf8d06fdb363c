"""Draws a view to a file: with pyvista in a process of its own, or plainly with matplotlib.

VTK loads the machine's graphics libraries and ends the process when there are none; so pyvista runs apart.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import warnings
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from kpred.atomic import atomic_path
from kpred.errors import OutputError
from kpred.rendering.draw_matplotlib import draw_plainly
from kpred.rendering.drawing_process import kept_drawing_process
from kpred.rendering.view import View

SECONDS = 180.0
"""After which drawing with pyvista is given up."""


class PictureWarning(UserWarning):
    """A picture was left out or drawn more plainly; the message says why and what to do."""


def check_png(path: str | os.PathLike[str]) -> Path:
    """Refuse a picture's file that is no PNG.

    Raises:
        OutputError: the extension is not .png.
    """
    target = Path(path)
    if target.suffix.lower() != ".png":
        raise OutputError(f"Cannot write {target}: pictures are .png files; give it that extension.")
    return target


def draw_view(view: View, path: str | os.PathLike[str]) -> bool:
    """Draw a view and write it as PNG, whole or not at all.

    Returns:
        Whether the picture was written. When neither pyvista nor matplotlib is installed or works, a `PictureWarning`
        says so and nothing is written.

    Raises:
        OutputError: the extension is not .png, or the file cannot be written there.
    """
    target = check_png(path)
    with tempfile.TemporaryDirectory(prefix="kpred-picture-") as folder:
        picture = Path(folder) / "picture.png"
        trouble = _draw_apart(view, Path(folder), picture)
        if trouble is not None:
            if find_spec("matplotlib") is None:
                warnings.warn(f"No picture: {trouble}.", PictureWarning, stacklevel=3)
                return False
            warnings.warn(f"Plain picture by matplotlib: {trouble}.", PictureWarning, stacklevel=3)
            draw_plainly(view, picture)
        with atomic_path(target) as temporary:
            temporary.write_bytes(picture.read_bytes())
    return True


def _draw_apart(view: View, folder: Path, picture: Path) -> str | None:
    """Draw with pyvista in another process; None when that worked, else a clause that says why not and the mend."""
    if find_spec("pyvista") is None:
        return "pyvista is not installed (pip install 'kpred[pictures]')"
    file = folder / "view.npz"
    arrays: dict[str, Any] = {**view.to_arrays()}
    np.savez(file, **arrays)
    kept = kept_drawing_process()
    if kept is not None and kept.draw(file, picture, SECONDS):
        return None
    # By path and not as a module: the other process then loads nothing of kpred, and no torch.
    script = Path(__file__).with_name("draw_pyvista.py")
    command = [sys.executable, "-P", str(script), str(file), str(picture)]
    try:
        done = subprocess.run(command, capture_output=True, stdin=subprocess.DEVNULL, timeout=SECONDS)
    except (OSError, subprocess.TimeoutExpired) as error:
        return f"drawing with pyvista failed ({type(error).__name__})"
    if done.returncode == 0 and picture.is_file() and picture.stat().st_size:
        return None
    picture.unlink(missing_ok=True)
    return "pyvista found no graphics library that works (on Debian or Ubuntu: apt-get install libegl1 libgl1-mesa-dri)"
