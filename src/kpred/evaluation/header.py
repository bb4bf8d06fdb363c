"""What a measurement was made by: weights and versions, so that rows can be read and repeated later."""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from kpred._version import __version__
from kpred.evaluation.methods.method import Method
from kpred.nn import KPRed, Model


def provenance(model: Model) -> dict[str, Any]:
    """Return name, fingerprints and settings of the weights, as plain values.

    `fingerprints` are of what makes a database, `weights` of all parts, those for partial scans too.
    """
    return {
        "model": model.name,
        "fingerprints": {category: network.fingerprint() for category, network in model.items()},
        "weights": {category: weights_hash(network) for category, network in model.items()},
        "settings": {category: network.config.to_dict() for category, network in model.items()},
        "recognizer": model.recognizer is not None,
    }


def models_of(models: Mapping[str, Model], methods: Sequence[Method]) -> dict[str, Any]:
    """Return the provenance of each model and each method that a table measures, by name."""
    found = {name: provenance(model) for name, model in models.items()}
    return found | {method.name: method.provenance for method in methods}


def weights_hash(network: KPRed) -> str:
    """Hash of all of a category's weights at half precision, as they are stored."""
    digest = hashlib.sha256()
    for key, value in sorted(network.state_dict().items()):
        digest.update(key.encode())
        digest.update(value.detach().cpu().half().numpy().tobytes())
    return digest.hexdigest()[:16]


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


def processor() -> str:
    """Name the processor as well as the system does."""
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as file:
            for line in file:
                if line.startswith("model name"):
                    return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()
