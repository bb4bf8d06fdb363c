"""The chosen candidate's mesh in the scan's own place and units, and where its undeformed model stands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import trimesh

from kpred.database import Database, Entry
from kpred.errors import DatabaseError
from kpred.fitting.explanation import Deformed, Explanation, ModelPoints
from kpred.ops.closest_point import closest_points
from kpred.ops.frames import Frame
from kpred.ops.typing import Float
from kpred.refinement.placement import Placement

SURFACE_POINTS = 512
"""Points of the scan whose distance to the result's surface is measured."""

OWN_SIZE = 0.06
"""A model whose placed size differs from its own by no more than this fraction has its own: scan noise is no larger."""


RESIZED = 1.5
"""A model that is placed larger or smaller than its own size by this factor is reported as resized."""


@dataclass(frozen=True, eq=False)
class PlacedModel:
    """Where an undeformed model of the database stands in the scan.

    Attributes:
        matrix: (4, 4), column vectors, from the model's own coordinates to the scan's.
        translation: (3,), rotation: (3, 3), scale: (3,): the same as translation @ rotation @ scale (9 DoF).
        own_size: whether the scale was set to 1, because the model and the scan are of one size.
    """

    matrix: Float[np.ndarray, "4 4"]
    translation: Float[np.ndarray, "3"]
    rotation: Float[np.ndarray, "3 3"]
    scale: Float[np.ndarray, "3"]
    own_size: bool

    @property
    def resized(self) -> bool:
        """Whether it is far from its own size: by more than `RESIZED` along an axis."""
        return bool(np.maximum(self.scale, 1.0 / self.scale).max() > RESIZED)


@dataclass(frozen=True, eq=False)
class Placed:
    """The result in the scan's frame and units.

    Attributes:
        row: of the chosen candidate; explanation: of it; entry: its model in the database.
        mesh: deformed; undeformed: the same model as it is, placed; model: where.
        keypoints: (K, 3) deformed.
        distance: mean distance from some of the scan's points to the mesh's surface, scan units.
    """

    row: int
    explanation: Explanation
    entry: Entry
    mesh: trimesh.Trimesh
    undeformed: trimesh.Trimesh
    model: PlacedModel
    keypoints: Float[np.ndarray, "keypoints 3"]
    distance: float


def place(deformed: Deformed, order: Sequence[int], frame: Frame, database: Database, known: bool = False) -> Placed:
    """Bring the chosen candidate, the first in `order`, back to where the scan is.

    Args:
        known: the scan lies in its unit box, which has no unit to compare a model's own size in.

    Raises:
        DatabaseError: it is no longer in the database, or its mesh is not finite once deformed.
    """
    row = order[0]
    entry = database.entry(deformed.candidates.model_ids[row])
    found = deformed.explanations[row]
    explanation = found if known else in_own_size(found, entry, frame)
    moved, keypoints = place_points(explanation, entry, frame)
    if not np.isfinite(moved).all():
        raise DatabaseError(
            f"Database {database.path}: the model {entry.model_id} is damaged (its deformed mesh is not finite); add "
            "it again."
        )
    mesh = trimesh.Trimesh(moved, entry.mesh.faces.copy(), process=False)
    model = place_model(explanation.placement, entry, frame, known)
    vertices = np.asarray(entry.mesh.vertices, dtype=np.float64)
    undeformed = trimesh.Trimesh(
        vertices @ model.matrix[:3, :3].T + model.matrix[:3, 3], entry.mesh.faces.copy(), process=False
    )
    target = deformed.candidates.target.numpy()
    some = target[:: max(1, len(target) // SURFACE_POINTS)].astype(np.float64)
    surface, _ = closest_points(some, frame.to_unit(moved), entry.mesh.faces)
    distance = float(surface.mean()) * frame.scale
    return Placed(row, explanation, entry, mesh, undeformed, model, keypoints, distance)


def place_mesh(explanation: Explanation, entry: Entry, frame: Frame) -> trimesh.Trimesh:
    """Deform a model's mesh as its explanation says; in the scan's frame and units."""
    return trimesh.Trimesh(place_points(explanation, entry, frame)[0], entry.mesh.faces.copy(), process=False)


def place_points(
    explanation: Explanation, entry: Entry, frame: Frame
) -> tuple[Float[np.ndarray, "vertices 3"], Float[np.ndarray, "keypoints 3"]]:
    """Deform a model's vertices and keypoints as its explanation says; in the scan's frame and units.

    Args:
        entry: the model as it is in the database; frame: takes the scan into its unit box.
    """
    vertices = entry.frame.to_unit(entry.mesh.vertices.astype(np.float64))
    keypoints = entry.keypoints.astype(np.float64)
    # A keypoint moves with the part of the vertex nearest to it.
    nearest = np.square(keypoints[:, None] - vertices[None]).sum(axis=2).argmin(axis=1)
    of_vertices = entry.structure.vertex_parts
    parts = np.concatenate([of_vertices, of_vertices[nearest]])
    basis = np.concatenate([entry.vertex_basis.astype(np.float64), np.eye(len(keypoints))])
    moved = frame.from_unit(explanation.deformation(ModelPoints(np.concatenate([vertices, keypoints]), parts, basis)))
    return moved[: len(vertices)], moved[len(vertices) :]


def in_own_size(explanation: Explanation, entry: Entry, frame: Frame) -> Explanation:
    """Give an undeformed model its own size, if it agrees with the scan's."""
    size = explanation.placement.size * frame.scale / entry.frame.scale
    if explanation.step != "none" or float(np.abs(size - 1.0).max()) >= OWN_SIZE:
        return explanation
    own = replace(explanation.placement, size=explanation.placement.size / size)
    return replace(explanation, placement=own, deformation=lambda model: own(model.points))


def place_model(placement: Placement, entry: Entry, frame: Frame, known: bool = False) -> PlacedModel:
    """Place the undeformed model: in its own size if that is the scan's, else in the size that fits."""
    size = placement.size * frame.scale / entry.frame.scale
    own = not known and bool(np.abs(size - 1.0).max() < OWN_SIZE)
    fitted = replace(placement, size=placement.size / size) if own else placement
    inward = np.eye(4)
    inward[:3, :3] = entry.frame.rotation / entry.frame.scale
    inward[:3, 3] = -entry.frame.rotation @ entry.frame.center / entry.frame.scale
    matrix = frame.matrix() @ fitted.matrix() @ inward
    scale = np.linalg.norm(matrix[:3, :3], axis=0)
    return PlacedModel(matrix, matrix[:3, 3], matrix[:3, :3] / scale, scale, own)
