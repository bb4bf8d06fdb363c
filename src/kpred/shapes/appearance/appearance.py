"""The file that a mesh came from, without its positions, and which vertex of the mesh each of its vertices is."""

from __future__ import annotations

import hashlib
import io
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.spatial import cKDTree

from kpred.ops.typing import Float, Int

Kind = Literal["obj", "gltf"]

_ARRAYS = ("vertex_map", "offsets", "rotation")
_DATE = (1980, 1, 1, 0, 0, 0)


_MAX_UNPACKED = 1 << 29
"""Bytes of all files of one model, decompressed."""


@dataclass(frozen=True, eq=False)
class Appearance:
    """A mesh file as a template; n vertices in the file, V in the mesh that was made of it.

    Attributes:
        kind: of the file; files: its parts by name, `model.obj` or `model.gltf` first.
        vertex_map: (n,) int32, the mesh's vertex that each vertex of the file is, or the one nearest to it.
        offsets: (n, 3) float32 from there in the mesh's frame; zero for vertices that the mesh has; (0, 3) if all are.
        rotation: (3, 3) from the file's axes to the mesh's.
    """

    kind: Kind
    files: Mapping[str, bytes]
    vertex_map: Int[np.ndarray, " n"]
    offsets: Float[np.ndarray, "offsets 3"]
    rotation: Float[np.ndarray, "3 3"]

    def rotated(self, rotation: Float[np.ndarray, "3 3"]) -> Appearance:
        """Belong to the mesh that was rotated."""
        offsets = (self.offsets @ rotation.T).astype(np.float32)
        return replace(self, rotation=rotation @ self.rotation, offsets=offsets)

    def reindexed(self, kept: Int[np.ndarray, " kept"]) -> Appearance | None:
        """Belong to the mesh of which only these vertices are left, in this order; None if one is lost."""
        count = int(max(self.vertex_map.max(initial=-1), kept.max(initial=-1))) + 1
        if np.array_equal(kept, np.arange(count)):
            return self
        places = np.full(count, -1, np.int32)
        places[kept] = np.arange(len(kept), dtype=np.int32)
        found = places[self.vertex_map]
        return None if (found < 0).any() else replace(self, vertex_map=found)

    def positions(
        self, source: Float[np.ndarray, "vertices 3"], result: Float[np.ndarray, "vertices 3"]
    ) -> Float[np.ndarray, "n 3"]:
        """Place the file's vertices as the mesh's went from `source` to `result`; (n, 3) float64."""
        placed: np.ndarray = np.asarray(result, dtype=np.float64)[self.vertex_map]
        if len(self.offsets):
            placed = placed + self.offsets.astype(np.float64) @ _linear(source, result)
        return placed

    def pack(self) -> bytes:
        """Compress to one archive; the same content gives the same bytes."""
        stream = io.BytesIO()
        with zipfile.ZipFile(stream, "w") as archive:
            for name in _ARRAYS:
                data = io.BytesIO()
                np.save(data, getattr(self, name), allow_pickle=False)
                _store(archive, f"{name}.npy", data.getvalue())
            for name, content in self.files.items():
                _store(archive, f"{self.kind}/{name}", content)
        return stream.getvalue()

    @classmethod
    def unpack(cls, data: bytes) -> Appearance:
        """Undo `pack`. Raises ValueError, KeyError or zipfile.BadZipFile for bytes that are none."""
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            bare = [name.partition("/")[2] for name in archive.namelist() if not name.endswith(".npy")]
            if any(not name or name.startswith(".") or "/" in name or "\\" in name for name in bare):
                raise ValueError("a file in a folder")
            if sum(item.file_size for item in archive.infolist()) > _MAX_UNPACKED:
                raise ValueError("more bytes than materials have")
            arrays = {name: np.load(io.BytesIO(archive.read(f"{name}.npy")), allow_pickle=False) for name in _ARRAYS}
            files = {
                name.partition("/")[2]: archive.read(name) for name in archive.namelist() if not name.endswith(".npy")
            }
            kind: Kind = "obj" if "model.obj" in files else "gltf"
        return cls(kind, files, **arrays)

    def digest(self) -> str:
        """Hash what is in the files, not where the vertices are; 16 hexadecimal digits."""
        total = hashlib.sha256()
        for name, content in self.files.items():
            total.update(f"{name} {len(content)} ".encode())
            total.update(content)
        return total.hexdigest()[:16]


def map_vertices(
    positions: Float[np.ndarray, "n 3"], rows: Int[np.ndarray, " n"], mesh_positions: Float[np.ndarray, "vertices 3"]
) -> tuple[Int[np.ndarray, " n"], Float[np.ndarray, "offsets 3"]]:
    """Map the vertices of a file to a mesh's: `rows` where they are not -1, else to the nearest with an offset."""
    loose = rows < 0
    if not loose.any():
        return rows.astype(np.int32), np.zeros((0, 3), np.float32)
    mapped, offsets = rows.astype(np.int32).copy(), np.zeros((len(rows), 3), np.float32)
    finite = np.where(np.isfinite(positions[loose]), positions[loose], 0.0)
    used = np.unique(rows[~loose])
    nearest = used[cKDTree(mesh_positions[used]).query(finite)[1]]
    mapped[loose] = nearest
    offsets[loose] = finite - mesh_positions[nearest]
    return mapped, offsets


def _linear(source: np.ndarray, result: np.ndarray) -> np.ndarray:
    """Fit the linear map, for row vectors, that comes nearest to what was done to all vertices."""
    left, right = (np.asarray(points, dtype=np.float64) for points in (source, result))
    return np.linalg.lstsq(left - left.mean(axis=0), right - right.mean(axis=0), rcond=None)[0]


def _store(archive: zipfile.ZipFile, name: str, content: bytes) -> None:
    is_packed = name.lower().endswith((".png", ".jpg", ".jpeg", ".webp", ".ktx2"))
    item = zipfile.ZipInfo(name, _DATE)
    item.compress_type = zipfile.ZIP_STORED if is_packed else zipfile.ZIP_DEFLATED
    archive.writestr(item, content, compresslevel=9)
