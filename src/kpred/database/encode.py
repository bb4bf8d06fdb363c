"""Encoding of a CAD mesh as a database entry: everything that depends on the source only (paper Sec. 3.1, 3.2).

mesh -> unit box -> 2048 points -> keypoints, tokens, cage and influence (network) -> deformation basis = mean value
coordinates x influence^T, for the points and for the mesh's vertices; structure of the mesh (`surface`).
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from kpred.database.entry import Entry
from kpred.database.surface import analyse_surface
from kpred.errors import MeshError, ScanError
from kpred.nn import KPRed
from kpred.nn.keypoints import thinned
from kpred.ops.cage import icosphere
from kpred.ops.frames import Frame, unit_box_frame
from kpred.ops.mean_value import mean_value_coordinates
from kpred.ops.sampling import sample_surface
from kpred.ops.typing import Float
from kpred.shapes.mesh import Mesh, clean_mesh

POINTS = 2048
"""Points sampled on a model (paper: N_P)."""

DEFAULT_SEED = 0
"""Seed of that sample where no other is given."""

_CAGE_VERTICES = 8192
"""Mesh vertices that the cage is built around, beside the points."""

_VERTEX_CHUNK = 20_000
"""Mesh vertices whose coordinates in the cage are held at once: some ten megabytes."""


@dataclass(frozen=True, eq=False)
class PreparedMesh:
    """A mesh made ready for the networks.

    Attributes:
        model_id: its name in the database, which also seeds its sampling.
        mesh: without faces of zero area and unused vertices, in its own frame and units.
        frame: from there into the unit box.
        vertices: (V, 3) float32, unit box.
        points: (N, 3) float32, unit box.
        point_faces: (N,) int64, the face of `mesh` that each point lies on.
    """

    model_id: str
    mesh: Mesh
    frame: Frame
    vertices: Tensor
    points: Tensor
    point_faces: Tensor


def prepare_mesh(mesh: Mesh, model_id: str, seed: int, count: int = POINTS) -> PreparedMesh:
    """Clean a mesh, scale it to its unit box and sample `count` points, which depend on mesh, id and seed only.

    Raises:
        MeshError: no face has an area, or the box has no size.
    """
    mesh = clean_mesh(replace(mesh, name=model_id))
    try:
        frame = unit_box_frame(mesh.vertices)
    except ScanError as error:
        raise MeshError(f"{model_id}: it has no size; give a mesh with at least one proper triangle.") from error
    vertices = torch.from_numpy(to_unit_box(mesh, frame))
    # torch keeps 32 bits of a seed on the CPU, so both go into one checksum.
    generator = torch.Generator().manual_seed(zlib.crc32(f"{seed} {model_id}".encode()))
    points, point_faces = sample_surface(vertices, torch.from_numpy(mesh.faces).long(), count, generator)
    return PreparedMesh(model_id, mesh, frame, vertices, points, point_faces)


def to_unit_box(mesh: Mesh, frame: Frame) -> Float[np.ndarray, "vertices 3"]:
    """Map the vertices of a mesh into its unit box, as float32."""
    return frame.to_unit(mesh.vertices.astype(np.float64)).astype(np.float32)


def encode_models(
    meshes: Sequence[Mesh],
    model_ids: Sequence[str],
    network: KPRed,
    seed: int,
    metadata: Sequence[dict[str, str]] | None = None,
    count: int = POINTS,
) -> list[Entry]:
    """Encode meshes of the network's category as entries, in one batch, on the network's device.

    `seed`: of the sampling; each model's points depend on it and on the model's id alone, not on the others.
    `metadata`: recorded with each model; none by default. `count`: points sampled on each.
    The entries are as a database gives them back (`Entry.rounded`).

    Raises:
        MeshError: a mesh has no face with an area.
    """
    if not len(meshes) == len(model_ids) == len(metadata or meshes):
        raise ValueError(f"{len(meshes)} meshes, {len(model_ids)} ids and {len(metadata or meshes)} metadata")
    prepared = [prepare_mesh(mesh, name, seed, count) for mesh, name in zip(meshes, model_ids, strict=True)]
    return encode_prepared(prepared, network, metadata)


@torch.no_grad()
def encode_prepared(
    prepared: Sequence[PreparedMesh],
    network: KPRed,
    metadata: Sequence[dict[str, str]] | None = None,
    category: str | None = None,
) -> list[Entry]:
    """Encode prepared meshes as `encode_models`; `category`: theirs, where it is not the network's."""
    if not prepared:
        return []
    device = next(network.parameters()).device
    points = torch.stack([item.points for item in prepared]).to(device)
    keypoints = network.keypoints(thinned(points))
    tokens = network.retrieval_tokens(points, keypoints)
    cage = torch.cat([network.cage(_hull(item)[None].to(device)) for item in prepared])
    influence = network.influence(points, keypoints, cage)
    fingerprint = network.fingerprint()
    entries = []
    for row, item in enumerate(prepared):
        analysis = analyse_surface(
            item.vertices.numpy(), item.mesh.faces, item.points.numpy(), item.point_faces.numpy()
        )
        entry = Entry(
            model_id=item.model_id,
            category=network.config.category if category is None else category,
            mesh=item.mesh,
            frame=item.frame,
            metadata=dict(metadata[row]) if metadata is not None else {},
            points=item.points.numpy(),
            keypoints=keypoints[row].cpu().numpy(),
            tokens=tokens[row].cpu().numpy(),
            point_basis=deformation_basis(points[row], cage[row], influence[row], network).cpu().numpy(),
            vertex_basis=deformation_basis(item.vertices.to(device), cage[row], influence[row], network).cpu().numpy(),
            structure=analysis.structure,
            point_parts=analysis.point_parts,
            point_normals=analysis.point_normals,
            fingerprint=fingerprint,
        )
        entries.append(entry.rounded())
    return entries


def _hull(item: PreparedMesh) -> Tensor:
    """Return points that the cage must enclose: the samples, and vertices that sampling may have missed."""
    step = -(-len(item.vertices) // _CAGE_VERTICES)
    return torch.cat([item.points, item.vertices[::step]])


def deformation_basis(
    positions: Float[Tensor, "positions 3"],
    cage: Float[Tensor, "vertices 3"],
    influence: Float[Tensor, "keypoints vertices"],
    network: KPRed,
    chunk: int = _VERTEX_CHUNK,
) -> Float[Tensor, "positions keypoints"]:
    """Compute B = W I^T, `chunk` rows at once: deformed positions are positions + B (K_target - K_source), unit box."""
    faces = icosphere(network.config.cage_subdivisions)[1].to(positions.device)
    parts = [mean_value_coordinates(part[None], cage[None], faces)[0] @ influence.T for part in positions.split(chunk)]
    return torch.cat(parts)
