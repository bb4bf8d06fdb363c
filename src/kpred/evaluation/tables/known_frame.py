"""Results in the known frame, category given: the stages of `kpred.fit`, with several deformations of one retrieval."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from kpred.database import Database, Entry
from kpred.fitting.candidates import Candidates
from kpred.fitting.deform import Deformation, ModelPoints, deform_candidates
from kpred.fitting.options import FitOptions
from kpred.fitting.selection import rank_candidates
from kpred.fitting.stages import CleanScan, Context, Tried, try_poses
from kpred.fitting.visibility import Visibility
from kpred.ops.frames import Frame
from kpred.ops.typing import Float
from kpred.pose.recognition import PoseHypothesis
from kpred.shapes.structure.cleanliness import Cleanliness, measure_cleanliness

UNIT_BOX = Frame(center=np.zeros(3), scale=1.0)
"""Frame of a scan that lies in its whole object's unit box."""


@dataclass(frozen=True, eq=False)
class Delivered:
    """A deformed model, as a fit delivers it.

    Attributes:
        entry: the model; points: (N, 3) of its deformed surface, unit box; deformation: of points of the model.
    """

    entry: Entry
    points: Float[Tensor, "points 3"]
    deformation: Deformation

    def cleanliness(self) -> Cleanliness:
        """Measure what the deformed mesh lost against the model's own."""
        source = self.entry.frame.to_unit(self.entry.mesh.vertices.astype(np.float64))
        basis = self.entry.vertex_basis.astype(np.float64)
        result = self.deformation(ModelPoints(source, self.entry.structure.vertex_parts, basis))
        return measure_cleanliness(source, result, np.asarray(self.entry.mesh.faces), self.entry.structure)


def retrieve_for(cloud: Float[Tensor, "points 3"], context: Context, options: FitOptions) -> Tried:
    """Encode a target's points in the known frame, and retrieve models of the one category of the context."""
    scan = CleanScan(cloud.double().numpy(), len(cloud), "y", None, ())
    return try_poses(scan, [PoseHypothesis(np.eye(3), context.categories[0])], context, options)


def deliver(candidates: Candidates, visibility: Visibility, database: Database, options: FitOptions) -> Delivered:
    """Deform the candidates, choose one, and place it as a fit in the known frame does."""
    deformed = deform_candidates(
        candidates,
        visibility,
        options.deform,
        refinement=options.refinement,
        structure=options.structure,
    )
    row = rank_candidates(deformed)[0]
    entry = database.entry(candidates.model_ids[row])
    found = deformed.explanations[row]
    return Delivered(entry, torch.from_numpy(found.points), found.deformation)


def undeformed(model_id: str, database: Database) -> Delivered:
    """The model as it is in its unit box."""
    entry = database.entry(model_id)
    return Delivered(entry, torch.from_numpy(entry.points), lambda model: model.points)
