"""What a learned model must beat: database shapes as they are, and deformation by keypoints that nobody learned."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from kpred.fitting.candidates import Candidates
from kpred.ops import (
    enclosing_cage,
    farthest_point_sampling,
    gaussian_influence,
    icosphere,
    mean_value_coordinates,
    squared_distances,
)
from kpred.ops.typing import Float

CHUNK = 64
"""Database shapes compared with a target at once."""

KEYPOINTS = 12
_BUILD_CHUNK = 16


def undeformed_errors(
    target: Float[Tensor, "target 3"], points: Float[Tensor, "models points 3"], partial: bool = False
) -> Float[Tensor, " models"]:
    """CD between the target and every database shape as it is, exact; only target to shape (UCD) for partial ones.

    All in the unit box; unit box squared.
    """
    errors = []
    for shapes in points.split(CHUNK):
        goal = target.expand(len(shapes), -1, -1)
        forth = squared_distances(goal, shapes).mean(1)
        errors.append(forth if partial else forth + squared_distances(shapes, goal).mean(1))
    return torch.cat(errors)


@dataclass(frozen=True, eq=False)
class NoLearning:
    """Database shapes with a deformation basis that needs no network.

    12 farthest points are the keypoints, their influence on an enclosing cage is a normalised Gaussian, the cage moves
    the shape by mean value coordinates. There are no keypoints of the target: refinement starts from no displacement.

    Attributes:
        model_ids: M ids; category: theirs.
        points: (M, N, 3) unit box; basis: (M, N, 12), S' = S + basis @ displacement.
    """

    model_ids: tuple[str, ...]
    category: str
    points: Tensor
    basis: Tensor

    @classmethod
    def build(
        cls,
        model_ids: tuple[str, ...],
        category: str,
        points: Float[Tensor, "models points 3"],
        progress: Callable[[int], None] | None = None,
    ) -> NoLearning:
        """Bases of all shapes; `progress` is called with the number of shapes that are done."""
        faces = icosphere()[1]
        bases: list[Tensor] = []
        for shapes in points.split(_BUILD_CHUNK):
            index = farthest_point_sampling(shapes, KEYPOINTS)
            keypoints = torch.gather(shapes, 1, index[..., None].expand(-1, -1, 3))
            cage = enclosing_cage(shapes)
            weights = mean_value_coordinates(shapes, cage, faces)
            bases.append(weights @ gaussian_influence(keypoints, cage).transpose(1, 2))
            if progress is not None:
                progress(sum(map(len, bases)))
        return cls(model_ids, category, points, torch.cat(bases))

    def candidates(self, target: Tensor, distances: Tensor, rows: Tensor, partial: bool) -> Candidates:
        """The models of `rows`, not moved yet, as the fit's own candidates; `distances`: (M,) undeformed errors."""
        chosen = rows.tolist()
        return Candidates(
            model_ids=tuple(self.model_ids[row] for row in chosen),
            category=self.category,
            distances=np.asarray(distances.numpy()[chosen]),
            points=self.points[rows],
            basis=self.basis[rows],
            displacement=torch.zeros(len(chosen), KEYPOINTS, 3),
            target=target,
            confidence=torch.ones(KEYPOINTS),
            partial=partial,
        )
