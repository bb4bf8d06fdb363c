"""Scan in, CAD mesh out: keypoint-driven retrieval and deformation of CAD models (KP-RED).

>>> import kpred
>>> fit = kpred.fit("chair.ply")          # doctest: +SKIP
>>> fit.mesh.export("chair.obj")          # doctest: +SKIP

The names below are loaded when first used, so that ``import kpred`` itself costs nothing.
"""

import os
from typing import TYPE_CHECKING

from kpred._lazy import lazy_names
from kpred._version import __version__

if TYPE_CHECKING:
    from kpred.batch import fit_many
    from kpred.database import Database
    from kpred.fitting import Fit, fit, sample_scan
    from kpred.fitting.fit_room import fit_room
    from kpred.fitting.fit_scene import SceneFit, fit_scene
    from kpred.nn import load_model
    from kpred.scenes.scene import read_scene
    from kpred.shapes import read_mesh, read_scan, write_mesh

# torch's OpenMP threads spin for milliseconds after each loop and keep compiled kernels of this package off the
# processor. Read when torch is loaded; who has said how threads wait is not overruled.
if "OMP_WAIT_POLICY" not in os.environ:
    os.environ.setdefault("GOMP_SPINCOUNT", "30000")

__all__ = [
    "Database",
    "Fit",
    "SceneFit",
    "__version__",
    "fit",
    "fit_many",
    "fit_room",
    "fit_scene",
    "load_model",
    "read_mesh",
    "read_scan",
    "read_scene",
    "sample_scan",
    "write_mesh",
]

_MODULES = {
    "Database": "kpred.database",
    "Fit": "kpred.fitting",
    "SceneFit": "kpred.fitting.fit_scene",
    "fit": "kpred.fitting.pipeline",  # the function: the package has a module of this name too
    "fit_many": "kpred.batch",
    "fit_room": "kpred.fitting.fit_room",
    "fit_scene": "kpred.fitting.fit_scene",
    "load_model": "kpred.nn",
    "read_mesh": "kpred.shapes",
    "read_scan": "kpred.shapes",
    "read_scene": "kpred.scenes.scene",
    "sample_scan": "kpred.fitting",
    "write_mesh": "kpred.shapes",
}

__getattr__, __dir__ = lazy_names(__name__, _MODULES)
