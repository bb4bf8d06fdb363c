"""One CAD model of the database, and how its arrays become bytes.

An entry holds all that retrieval and deformation need of a CAD model, so that nothing about it is computed again when
a scan is fitted. Arrays are stored little-endian. Some are stored with less precision than they are computed, far
below what a fit can tell (its mean distance is some hundredths of the unit box):

- tokens: float16;
- points: whole multiples of 2^-14 of the unit box (half a step is 0.03 mm for furniture of 2 m);
- vertex_basis: whole multiples of 2^-12, which is the spacing of float16 between 0.25 and 0.5, where the large weights
  lie; small weights compress better than as float16;
- point_basis: whole multiples of 2^-10: moving keypoints by 0.3 shifts a point by 0.0003 too much or too little.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from kpred.errors import DatabaseError
from kpred.ops.frames import Frame
from kpred.shapes.mesh import Mesh

POINT_STEP = 2.0**-14
VERTEX_BASIS_STEP = 2.0**-12
POINT_BASIS_STEP = 2.0**-10


class DamagedArray(ValueError):
    """Bytes of an array that do not make up the array they should."""


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
    fingerprint: str = field(default="")
    """of the weights that made keypoints, tokens and bases"""

    def rounded(self) -> Entry:
        """This entry as it comes back from a database: stored and read again, it stays the same to the bit."""
        return replace(
            self,
            points=_on_grid(self.points, POINT_STEP),
            keypoints=np.asarray(self.keypoints, dtype=np.float32),
            tokens=np.asarray(self.tokens, dtype=np.float16).astype(np.float32),
            point_basis=_on_grid(self.point_basis, POINT_BASIS_STEP),
            vertex_basis=_on_grid(self.vertex_basis, VERTEX_BASIS_STEP),
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


def pack_frame(frame: Frame) -> bytes:
    """Rotation (9 numbers, rows first), scale (1) and centre (3) as 13 little-endian float64."""
    numbers = np.concatenate([np.reshape(frame.rotation, 9), [frame.scale], np.reshape(frame.center, 3)])
    return numbers.astype("<f8").tobytes()


def unpack_frame(data: bytes) -> Frame:
    """Undo `pack_frame`."""
    numbers = np.frombuffer(data, dtype="<f8").astype(np.float64)
    return Frame(rotation=numbers[:9].reshape(3, 3), scale=float(numbers[9]), center=numbers[10:13])


def pack_array(array: np.ndarray, dtype: str, step: float | None = None) -> dict[str, Any]:
    """An array as the columns dtype, shape, step, codec, data.

    With a `step` the array is stored as whole multiples of it, in the integers `dtype`, or as float32 where these
    are too small. The bytes are compressed by zlib after putting all first bytes of the numbers together, then all
    second ones and so on (the high bytes are alike), and left as they are where that does not pay.
    """
    source = np.asarray(array)
    if step is not None:
        multiples = np.rint(np.asarray(source, dtype=np.float64) / step)
        if np.abs(multiples).max(initial=0.0) <= np.iinfo(dtype).max:
            source = multiples
        else:
            source, dtype, step = _on_grid(source, step), "<f4", None
    stored = np.ascontiguousarray(source.astype(dtype))
    raw = stored.tobytes()
    shuffled = np.frombuffer(raw, np.uint8).reshape(-1, stored.itemsize).T.tobytes()
    packed = zlib.compress(shuffled, 9)
    small = len(packed) < 0.97 * len(raw)
    return {
        "dtype": dtype,
        "shape": ",".join(str(size) for size in stored.shape),
        "step": step,
        "codec": "shuffle-zlib" if small else "raw",
        "data": packed if small else raw,
    }


def unpack_array(dtype: str, shape: str, step: float | None, codec: str, data: bytes) -> np.ndarray:
    """Undo `pack_array`: float32 for floats and stepped arrays, int32 or int16 for integers; always writable.

    Raises DamagedArray.
    """
    kind = np.dtype(dtype)
    try:
        if codec == "shuffle-zlib":
            data = np.frombuffer(zlib.decompress(data), np.uint8).reshape(kind.itemsize, -1).T.tobytes()
        array = np.frombuffer(data, dtype=kind).reshape([int(size) for size in shape.split(",")])
    except (zlib.error, ValueError) as error:
        raise DamagedArray(f"{len(data)} bytes ({codec}) are no {dtype} array of shape {shape}") from error
    if step is not None:
        return array.astype(np.float32) * np.float32(step)
    if kind.kind == "f":
        return array.astype(np.float32)
    return array.astype(np.int16 if kind == np.dtype("<i2") else np.int32)


def pack_arrays(entry: Entry) -> dict[str, dict[str, Any]]:
    """Name -> columns of every array of an entry but keypoints and tokens, which search reads on their own."""
    narrow = len(entry.mesh.vertices) <= np.iinfo(np.uint16).max
    arrays = {
        "vertices": pack_array(entry.mesh.vertices, "<f4"),
        "faces": pack_array(entry.mesh.faces, "<u2" if narrow else "<i4"),
        "points": pack_array(entry.points, "<i2", POINT_STEP),
        "point_basis": pack_array(entry.point_basis, "<i2", POINT_BASIS_STEP),
        "vertex_basis": pack_array(entry.vertex_basis, "<i2", VERTEX_BASIS_STEP),
    }
    if entry.mesh.face_parts is not None:
        arrays["face_parts"] = pack_array(entry.mesh.face_parts, "<i2")
    return arrays


def _on_grid(array: np.ndarray, step: float) -> np.ndarray:
    """The nearest whole multiples of `step` (a power of two, so float32 holds them exactly)."""
    return (np.rint(np.asarray(array, dtype=np.float64) / step) * step).astype(np.float32)
