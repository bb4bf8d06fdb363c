"""What became of one object of a scene: its fit, or the reason why there is none."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import trimesh

from kpred.fitting.result import Candidate, Fit
from kpred.ops.typing import Float
from kpred.scenes.objects import SceneObject
from kpred.scenes.scan2cad import Alignment, decompose
from kpred.shapes.categories import synset_of

_HALF_TURN = np.diag([-1.0, 1.0, -1.0])
"""Canonical axes (y up, front +z) <-> ShapeNetCore.v2's (y up, front -z)."""


@dataclass(frozen=True, eq=False)
class ObjectFit:
    """What became of one object.

    Attributes:
        object: the object.
        fit: its fit; None where there is none.
        error: why there is none, one sentence that names the object.
        skipped: the object is of a category that the model or the database does not know, so that nothing was tried.
        floor: height of the floor it was taken to stand on, along the scene's up axis; None where it is unknown.
        shares: name of an equal object whose model and deformation it has; None where they are its own.
    """

    object: SceneObject
    fit: Fit | None = None
    error: str | None = None
    skipped: bool = False
    floor: float | None = None
    shares: str | None = None

    def cad_mesh(self) -> trimesh.Trimesh:
        """Return the deformed mesh in ShapeNet's frame: y up, front -z, centred, box diagonal 1."""
        assert self.fit is not None
        to_cad = np.linalg.inv(self.cad_to_scan())
        vertices = np.asarray(self.fit.mesh.vertices) @ to_cad[:3, :3].T + to_cad[:3, 3]
        return trimesh.Trimesh(vertices, np.asarray(self.fit.mesh.faces), process=False)

    def cad_to_scan(self) -> np.ndarray:
        """Return the similarity (4, 4), column vectors, from the frame of `cad_mesh` to the scene's frame and units."""
        assert self.fit is not None
        box = self.fit.frame.to_unit(np.asarray(self.fit.mesh.vertices, dtype=np.float64))
        low, high = box.min(axis=0), box.max(axis=0)
        cad_to_unit = np.eye(4)
        cad_to_unit[:3, :3] = _HALF_TURN * np.linalg.norm(high - low)
        cad_to_unit[:3, 3] = (low + high) / 2
        return self.fit.frame.matrix() @ cad_to_unit

    def alignment(self, mesh: str = "") -> Alignment:
        """Return the pose of the deformed mesh in Scan2CAD's terms; `mesh`: the file that holds it."""
        assert self.fit is not None
        translation, rotation, scale = decompose(self.cad_to_scan())
        return Alignment(
            catid_cad=synset_of(self.fit.category),
            id_cad=self.fit.source.model_id,
            translation=translation,
            rotation=rotation,
            scale=scale,
            half_size=np.ptp(np.asarray(self.cad_mesh().vertices), axis=0) / 2,
            mesh=mesh,
            node=self.node,
            name=self.object.name,
        )

    @property
    def node(self) -> str:
        """Name of its node in the GLB: object and model id."""
        return f"{self.object.name} {self.fit.source.model_id}" if self.fit is not None else self.object.name

    def moved(self, offset: Float[np.ndarray, "3"]) -> ObjectFit:
        """Return the same result moved by an offset, scene's frame and unit."""
        return self if self.fit is None else replace(self, fit=_moved(self.fit, offset))

    def rotated(self, rotation: Float[np.ndarray, "3 3"]) -> ObjectFit:
        """Return the same result and its scan in a rotated frame: a point p is at `rotation @ p` there."""
        item = replace(self.object, points=self.object.points @ rotation.T)
        return replace(self, object=item, fit=None if self.fit is None else self.fit.rotated(rotation))

    def to_json(self) -> dict[str, Any]:
        """Return everything but the mesh, as plain values."""
        facts: dict[str, Any] = {
            "name": self.object.name,
            "category": self.object.category,
            "points": len(self.object.points),
            "status": "fitted" if self.fit is not None else "skipped" if self.skipped else "failed",
            "error": self.error,
        }
        if self.object.annotation is not None:
            annotation = self.object.annotation
            facts["annotation"] = {
                "catid_cad": annotation.catid_cad,
                "id_cad": annotation.id_cad,
                "sym": annotation.sym,
            }
        if self.fit is not None:
            facts |= {
                "node": self.node,
                "shares": self.shares,
                "detection_score": self.object.score,
                "confidence": self.fit.confidence,
                "warnings": list(self.fit.warnings),
                "floor": self.floor,
                "cad_to_scan": self.cad_to_scan().tolist(),
                "fit": self.fit.to_json(),
            }
        return facts


def _moved(fit: Fit, offset: np.ndarray) -> Fit:
    """Move a fit by an offset (3,), scan's frame and unit; its scan stays."""
    matrix = np.eye(4)
    matrix[:3, 3] = offset
    placement = replace(
        fit.placement, matrix=matrix @ fit.placement.matrix, translation=fit.placement.translation + offset
    )
    return replace(
        fit,
        mesh=fit.mesh.copy().apply_transform(matrix),
        retrieved_mesh=fit.retrieved_mesh.copy().apply_transform(matrix),
        placement=placement,
        frame=replace(fit.frame, center=fit.frame.center + offset),
        keypoints=fit.keypoints + offset,
        candidates=tuple(_moved_candidate(one, matrix) for one in fit.candidates),
    )


def _moved_candidate(candidate: Candidate, matrix: np.ndarray) -> Candidate:
    return replace(candidate, read_mesh=lambda: candidate.mesh.copy().apply_transform(matrix))
