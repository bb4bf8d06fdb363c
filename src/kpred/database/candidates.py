"""What fitting reads of the database about the models it tries, and the memory that keeps it."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from threading import Lock
from typing import Generic, TypeVar

import numpy as np

from kpred.database.rows import FittingArrays
from kpred.errors import DatabaseError
from kpred.ops.typing import Float, Int
from kpred.shapes.structure import Structure

Value = TypeVar("Value")


@dataclass(frozen=True, eq=False)
class Candidates:
    """What fitting needs of M models of one category, as float32 arrays in the unit box of each model.

    Attributes:
        keypoints: (M, K, 3); points: (M, N, 3).
        point_basis: (M, N, K): deformed points are points + point_basis @ (target keypoints - keypoints).
        point_parts: (M, N) int16, part of its model that each point lies on.
        point_normals: (M, N, 3) unit normals of the surface, away from the middle of the part's own box.
        structures: of each model; their `vertex_parts` and `facets` are empty, `Database.entry` has them.
    """

    model_ids: tuple[str, ...]
    keypoints: Float[np.ndarray, "models keypoints 3"]
    points: Float[np.ndarray, "models points 3"]
    point_basis: Float[np.ndarray, "models points keypoints"]
    point_parts: Int[np.ndarray, "models points"]
    point_normals: Float[np.ndarray, "models points 3"]
    structures: tuple[Structure, ...]


class ModelCache(Generic[Value]):
    """What was read last of models, at most `most` of them; threads may share it."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._kept: OrderedDict[str, Value] = OrderedDict()
        self._lock = Lock()

    def get(self, model_ids: Iterable[str]) -> dict[str, Value]:
        """Those of the models that are there."""
        with self._lock:
            return {name: self._kept[name] for name in model_ids if name in self._kept}

    def put(self, found: Mapping[str, Value]) -> None:
        """Keep these; the oldest go."""
        with self._lock:
            self._kept.update(found)
            while len(self._kept) > self._most:
                self._kept.popitem(last=False)

    def clear(self) -> None:
        """Forget all."""
        with self._lock:
            self._kept.clear()


def stacked(category: str, model_ids: Sequence[str], found: Mapping[str, FittingArrays], where: str) -> Candidates:
    """Arrays of models of one category, one after the other; `where` they are from, for messages.

    Raises DatabaseError: a model is of another category, or they have different numbers of points.
    """
    models = [found[name] for name in model_ids]
    strangers = [name for name, model in zip(model_ids, models, strict=True) if model.category != category]
    if strangers:
        raise DatabaseError(f"Database {where}: {strangers[0]} is no {category}; search that category again.")
    if len({model.points.shape for model in models}) > 1:
        raise DatabaseError(f"Database {where}: models have different numbers of points; build it again.")
    return Candidates(
        model_ids=tuple(model_ids),
        keypoints=np.stack([model.keypoints for model in models]),
        points=np.stack([model.points for model in models]),
        point_basis=np.stack([model.point_basis for model in models]),
        point_parts=np.stack([model.point_parts for model in models]),
        point_normals=np.stack([model.point_normals for model in models]),
        structures=tuple(model.structure for model in models),
    )
