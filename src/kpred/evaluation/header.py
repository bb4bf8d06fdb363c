"""What a measurement was made by: weights and versions, so that rows can be read and repeated later."""

from __future__ import annotations

import platform
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from kpred import __version__
from kpred.nn import Model


def made_by(model: Model) -> dict[str, Any]:
    """Name and fingerprints of the weights, as plain values."""
    return {
        "model": model.name,
        "fingerprints": {category: network.fingerprint() for category, network in model.items()},
        "recognizer": model.recognizer is not None,
    }


def versions() -> dict[str, str]:
    """Versions of kpred, Python and the libraries that numbers depend on."""
    libraries = ("torch", "numpy", "numba", "trimesh", "SQLAlchemy")
    return {
        "kpred": __version__,
        "python": platform.python_version(),
        **{name: _version(name) for name in libraries},
    }


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"
