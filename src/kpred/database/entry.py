"""One CAD model of the database, and how its arrays become bytes.

An entry holds all that retrieval and deformation need of a CAD model, so that nothing about it is computed again when
a scan is fitted. Arrays are stored little-endian. Some are stored with less precision than they are computed, far
below the error of a fit (its mean distance is some hundredths of the unit box):

- tokens: float16;
- points: whole multiples of 2^-14 of the unit box (half a step is 0.03 mm for furniture of 2 m);
- vertex_basis: whole multiples of 2^-12, which is the spacing of float16 between 0.25 and 0.5, where the large weights
  lie; small weights compress better than as float16;
- point_basis: whole multiples of 2^-9: moving keypoints by 0.3 shifts a point by 0.0003 too much or too little;
- point_normals: whole multiples of 1/127, half a degree off at most;
- structure: float32.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from kpred.database.arrays import DamagedArray, on_grid, pack_array
from kpred.database.curve_coding import pack_along_curve
from kpred.database.structure_arrays import (
    NORMAL_STEP,
    check_point_structure,
    check_structure,
    pack_structure,
    rounded_structure,
)
from kpred.errors import DatabaseError
from kpred.ops.frames import Frame
from kpred.shapes.mesh import Mesh
from kpred.shapes.structure import Structure

APPEARANCE = "appearance"
"""Name of the array of what a model's file held beside positions; large, and read only to write results."""

POINT_STEP = 2.0**-14
VERTEX_BASIS_STEP = 2.0**-12
POINT_BASIS_STEP = 2.0**-9


@dataclass(frozen=True, eq=False)
class Entry:
    """A CAD model with what the networks and the cage say about it; V mesh vertices, N points, K keypoints.

    The deformed shape is `S + basis @ (K_target - K_source)` in the unit box, for points and mesh vertices alike.
    """

    model_id: str
    category: str
    mesh: Mesh
    """in the model's own frame and units"""
    frame: Frame
    """takes the mesh into its unit box"""
    metadata: dict[str, str]
    points: np.ndarray
    """(N, 3), unit box"""
    keypoints: np.ndarray
    """(K, 3), unit box"""
    tokens: np.ndarray
    """(K, C) retrieval tokens"""
    point_basis: np.ndarray
    """(N, K)"""
    vertex_basis: np.ndarray
    """(V, K)"""
    structure: Structure
    """parts, contacts, symmetry and facets of the mesh, unit box"""
    point_parts: np.ndarray
    """(N,) int16 part that each point lies on"""
    point_normals: np.ndarray
    """(N, 3) unit normals of the faces that the points lie on, away from the middle of the part's own box"""
    fingerprint: str = field(default="")
    """of the weights that made keypoints, tokens and bases"""
    appearance: bytes | None = field(default=None, repr=False)
    """packed (`kpred.shapes.appearance`), of an entry that is to be stored; `Database.appearance` reads it back"""

    def rounded(self) -> Entry:
        """Return this entry with the precision that the database stores."""
        return replace(
            self,
            points=on_grid(self.points, POINT_STEP),
            keypoints=np.asarray(self.keypoints, dtype=np.float32),
            tokens=np.asarray(self.tokens, dtype=np.float16).astype(np.float32),
            point_basis=on_grid(self.point_basis, POINT_BASIS_STEP),
            vertex_basis=on_grid(self.vertex_basis, VERTEX_BASIS_STEP),
            structure=rounded_structure(self.structure),
            point_parts=np.asarray(self.point_parts, dtype=np.int16),
            point_normals=on_grid(self.point_normals, NORMAL_STEP),
        )

    def check(self) -> None:
        """Raise DatabaseError when shapes disagree or a number is not finite or too large to store."""
        count, n_points, n_vertices = len(self.keypoints), len(self.points), len(self.mesh.vertices)
        wanted = {
            "points": (self.points, (n_points, 3)),
            "keypoints": (self.keypoints, (count, 3)),
            "tokens": (self.tokens, (count, *np.shape(self.tokens)[1:2])),
            "point_basis": (self.point_basis, (n_points, count)),
            "vertex_basis": (self.vertex_basis, (n_vertices, count)),
            "mesh.vertices": (self.mesh.vertices, (n_vertices, 3)),
        }
        if not self.model_id or not self.category:
            raise DatabaseError("An entry needs a model id and a category; give it both.")
        for name, (array, shape) in wanted.items():
            if np.shape(array) != shape or len(shape) != 2:
                raise DatabaseError(
                    f"Model {self.model_id}: {name} has shape {np.shape(array)}, {shape} is wanted; encode it again."
                )
            if not np.isfinite(array).all():
                raise DatabaseError(f"Model {self.model_id}: {name} holds NaN or infinite numbers; leave it out.")
        if np.abs(self.tokens).max(initial=0.0) > np.finfo(np.float16).max:
            raise DatabaseError(f"Model {self.model_id}: tokens too large for float16; leave this model out.")
        try:
            check_structure(self.structure, n_vertices, len(self.mesh.faces))
            check_point_structure(self.point_parts, self.point_normals, n_points, self.structure.parts)
        except DamagedArray as error:
            raise DatabaseError(f"Model {self.model_id}: {error}; encode it again.") from error


def pack_frame(frame: Frame) -> bytes:
    """Pack rotation (9 numbers, by rows), scale (1) and centre (3) as 13 little-endian float64."""
    numbers = np.concatenate([np.reshape(frame.rotation, 9), [frame.scale], np.reshape(frame.center, 3)])
    return numbers.astype("<f8").tobytes()


def unpack_frame(data: bytes) -> Frame:
    """Undo `pack_frame`."""
    numbers = np.frombuffer(data, dtype="<f8").astype(np.float64)
    return Frame(rotation=numbers[:9].reshape(3, 3), scale=float(numbers[9]), center=numbers[10:13])


def pack_arrays(entry: Entry) -> dict[str, dict[str, Any]]:
    """Name -> columns of every array of an entry but keypoints and tokens, which search reads on their own."""
    narrow = len(entry.mesh.vertices) <= np.iinfo(np.uint16).max
    arrays = {
        "vertices": pack_array(entry.mesh.vertices, "<f4"),
        "faces": pack_array(entry.mesh.faces, "<u2" if narrow else "<i4"),
        "points": pack_array(entry.points, "<i2", POINT_STEP),
        "point_basis": pack_along_curve(entry.point_basis, "<i2", POINT_BASIS_STEP, on_grid(entry.points, POINT_STEP)),
        "vertex_basis": pack_along_curve(
            entry.vertex_basis, "<i2", VERTEX_BASIS_STEP, np.asarray(entry.mesh.vertices, np.float32)
        ),
        **pack_structure(entry.structure, entry.point_parts, entry.point_normals),
    }
    if entry.mesh.face_parts is not None:
        arrays["face_parts"] = pack_array(entry.mesh.face_parts, "<i2")
    if entry.appearance is not None:
        arrays[APPEARANCE] = pack_array(np.frombuffer(entry.appearance, np.uint8), "<u1")
    return arrays
