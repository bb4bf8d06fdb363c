"""What is doubtful about the models of a database: fronts, sizes, twins, licences, very many faces."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
import torch

from kpred.database.database import Database
from kpred.database.entry import Entry
from kpred.nn import Recognizer
from kpred.ops.rotations import yaw_rotation

_POINTS = 384

FRONT_MARGIN = 3.0
"""Log-odds by which another front must be likelier than +z."""

LONGEST, SHORTEST = 6.0, 0.05
"""Longest side of furniture, metres, beyond which another unit is likely."""

MANY_FACES = 200_000
_FRONTS = ("z", "-x", "-z", "x")
_TURNS = np.radians([0, 90, 180, 270])
"""A model with the front -x faces +z after a quarter turn about y."""

_FINE = np.radians([-10, 0, 10])


class Doubt(NamedTuple):
    """One model's doubtful fact: `kind` is front, size, twice, licence or faces."""

    model_id: str
    kind: str
    sentence: str


def check_models(
    database: Database, recognizer: Recognizer | None, progress: Callable[[int, int], None] | None = None
) -> Iterator[Doubt]:
    """Yield what is doubtful about each model; fronts where the recognizer knows the category."""
    names, first = database.model_ids(), dict[str, str]()
    facts = database.all_metadata()
    for done, name in enumerate(names, start=1):
        entry = database.entry(name)
        missing = [key for key in ("author", "licence") if not facts[name].get(key)]
        if missing:
            yield Doubt(name, "licence", f"no {' and no '.join(missing)}; name it in the manifest")
        twin = first.setdefault(_shape_hash(entry), name)
        if twin != name:
            yield Doubt(name, "twice", f"the same mesh as {twin}; remove one of them")
        side = float(np.ptp(entry.mesh.vertices, axis=0).max())
        if not SHORTEST <= side <= LONGEST:
            yield Doubt(name, "size", f"longest side {side:.4g}: not in metres? name width, height, depth")
        if len(entry.mesh.faces) > MANY_FACES:
            yield Doubt(name, "faces", f"{len(entry.mesh.faces)} faces make it slow; simplify it")
        front = None if recognizer is None else likely_front(entry, recognizer)
        if front not in (None, "z"):
            yield Doubt(name, "front", f"the front seems to be {front}; see `kpred plot catalogue`, and name it")
        if progress is not None:
            progress(done, len(names))


def likely_front(entry: Entry, recognizer: Recognizer) -> str | None:
    """Guess the axis of a model's front, `z` unless another is far likelier; None for an unknown category."""
    known = recognizer.config.categories
    if entry.category not in known:
        return None
    rotations = [yaw_rotation(float(turn + fine)) for turn in _TURNS for fine in _FINE]
    clouds = np.stack([entry.points[:_POINTS] @ rotation.T for rotation in rotations])
    with torch.inference_mode():
        logits, _ = recognizer.predict_ensemble(torch.from_numpy(clouds).float())
    odds = (logits[:, known.index(entry.category)] - logits[:, -1]).double().numpy()
    best = odds.reshape(len(_TURNS), -1).max(axis=1)
    return _FRONTS[int(best.argmax())] if best.max() > best[0] + FRONT_MARGIN else "z"


def _shape_hash(entry: Entry) -> str:
    """Hash a mesh in its unit box, so that unit and place do not count."""
    unit = np.round(entry.frame.to_unit(entry.mesh.vertices.astype(float)), 4) + 0.0
    return hashlib.sha256(unit.tobytes() + entry.mesh.faces.tobytes()).hexdigest()
