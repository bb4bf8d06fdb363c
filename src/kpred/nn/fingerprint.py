"""Fingerprint of a whole model: all of its networks, its calibration and its settings."""

from __future__ import annotations

import hashlib
from weakref import WeakKeyDictionary

from torch import nn

from kpred.nn.loading import Model

_known: WeakKeyDictionary[Model, str] = WeakKeyDictionary()
"""Hashing all weights takes some hundredths of a second: once for each model."""


def weights_fingerprint(model: Model) -> str:
    """Hash all that results depend on in a model, as 64 hexadecimal digits; its name is no part of it."""
    found = _known.get(model)
    if found is None:
        found = _known[model] = _hashed(model)
    return found


def _hashed(model: Model) -> str:
    digest = hashlib.sha256()
    parts: dict[str, nn.Module] = {**model.networks}
    parts |= {f"/{name}": part for name, part in model.scan_networks.items()}
    for name, part in sorted(parts.items()):
        digest.update(f"{name} {getattr(part, 'config', '')!r}\n".encode())
        for key, value in sorted(part.state_dict().items()):
            digest.update(f"{key} {tuple(value.shape)}\n".encode())
            digest.update(value.detach().cpu().numpy().tobytes())
    digest.update(repr(model.calibration).encode())
    if model.shared_calibration is not None:
        digest.update(repr(model.shared_calibration).encode())
    return digest.hexdigest()
