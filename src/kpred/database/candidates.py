"""Arrays of several models of one category, as fitting reads them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from kpred.database.rows import FittingArrays
from kpred.errors import DatabaseError
from kpred.ops.typing import Float, Int
from kpred.shapes.structure import Structure


@dataclass(frozen=True, eq=False)
class Candidates:
    """What fitting needs of M models of one category, as float32 arrays in the unit box of each model.

    Attributes:
        keypoints: (M, K, 3); points: (M, N, 3).
        point_basis: (M, N, K): deformed points are points + point_basis @ (target keypoints - keypoints).
        point_parts: (M, N) int16, part of its model that each point lies on.
        point_normals: (M, N, 3) unit normals of the surface, away from the middle of the part's own box.
        scales: (M,) half the longest side of each model's box, in its own unit.
        structures: of each model; their `vertex_parts` and `facets` are empty, `Database.entry` has them.
    """

    model_ids: tuple[str, ...]
    keypoints: Float[np.ndarray, "models keypoints 3"]
    points: Float[np.ndarray, "models points 3"]
    point_basis: Float[np.ndarray, "models points keypoints"]
    point_parts: Int[np.ndarray, "models points"]
    point_normals: Float[np.ndarray, "models points 3"]
    structures: tuple[Structure, ...]
    scales: Float[np.ndarray, " models"]


def stack_candidates(
    category: str, model_ids: Sequence[str], found: Mapping[str, FittingArrays], where: str
) -> Candidates:
    """Stack the arrays of models of one category; `where` they are from, for messages.

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
        scales=np.array([model.scale for model in models]),
    )
