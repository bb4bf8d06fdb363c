"""Choose a few models of many that together explain other shapes of their category best, for a small database.

Every model of a pool is deformed, in a few rounds, to shapes that are not in it; models are then taken one after the
other, each time the one by which the log errors of the shapes' best and second best model fall most. The best alone
would be taken for its shape; the second best stands in for it where retrieval misses it.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import torch
from rich.progress import track

from kpred.database import Database, build_database
from kpred.fitting.candidates import MAX_MODELS, retrieve
from kpred.fitting.deform import sketch_errors
from kpred.fitting.encoding import encode_scan
from kpred.fitting.visibility import all_seen
from kpred.nn import load_model
from kpred.ops.sampling import sample_surface
from kpred.shapes import Mesh

SCAN_POINTS = 2048
UNEXPLAINED = -3.0
"""Log error of a shape that no model explains."""


def choose_models(
    pool: Sequence[tuple[str, Mesh]], shapes: Sequence[Mesh], weights: np.ndarray, category: str, count: int
) -> list[str]:
    """List the ids of `count` models of a pool that together explain shapes (S,) of these weights best."""
    ids, errors = sketch_all(pool, shapes, category)
    return [ids[row] for row in choose_columns(errors, weights, count)]


def choose_columns(errors: np.ndarray, weights: np.ndarray, count: int) -> list[int]:
    """Choose `count` columns of log errors (S, M) by which the weighted best and second best of the rows fall most."""
    best = np.full(len(errors), UNEXPLAINED)
    second = best.copy()
    chosen: list[int] = []
    for _ in range(min(count, errors.shape[1])):
        nearest = np.minimum(best[:, None], errors)
        next_nearest = np.minimum(np.maximum(best[:, None], errors), second[:, None])
        total = weights @ (nearest + next_nearest)
        total[chosen] = np.inf
        row = int(total.argmin())
        chosen.append(row)
        best, second = nearest[:, row], next_nearest[:, row]
    return chosen


def sketch_all(
    pool: Sequence[tuple[str, Mesh]], shapes: Sequence[Mesh], category: str
) -> tuple[tuple[str, ...], np.ndarray]:
    """Deform every model of a pool to every shape in a few rounds: ids (M,) and log errors (S, M)."""
    ids: tuple[str, ...] = ()
    errors: list[np.ndarray] = []
    for first in range(0, len(pool), MAX_MODELS):
        names, found = _sketch_some(pool[first : first + MAX_MODELS], shapes, category)
        ids += names
        errors.append(found)
    return ids, np.hstack(errors)


def _sketch_some(
    pool: Sequence[tuple[str, Mesh]], shapes: Sequence[Mesh], category: str
) -> tuple[tuple[str, ...], np.ndarray]:
    """Deform as many models as are kept ready at a time."""
    model = load_model()
    with TemporaryDirectory() as folder:
        path = Path(folder) / "pool.kpred"
        build_database(path, [(name, category, "pool", mesh) for name, mesh in pool], model)
        with Database.open(path) as database:
            ids = tuple(database.model_ids(category))
            errors = np.empty((len(shapes), len(ids)))
            for row, mesh in enumerate(track(shapes, f"deforming {len(ids)} models to shapes")):
                encoding = encode_scan(surface(mesh, row)[None], model[category], partial=False)
                found = retrieve(encoding, 0, database, category, len(ids), partial=False)
                place = {name: column for column, name in enumerate(found.model_ids)}
                sketched = sketch_errors(found, all_seen())
                errors[row] = [sketched[place[name]] for name in ids]
    return ids, errors


def surface(mesh: Mesh, seed: int) -> torch.Tensor:
    """Sample points (N, 3) of a mesh's surface, in its unit box."""
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    vertices = torch.from_numpy((mesh.vertices - (low + high) / 2) / ((high - low).max() / 2)).float()
    generator = torch.Generator().manual_seed(seed)
    return sample_surface(vertices, torch.from_numpy(mesh.faces).long(), SCAN_POINTS, generator)[0]
