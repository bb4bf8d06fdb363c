"""Fingerprint of a database's content, by which a record of a fit knows it again."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Set

from sqlalchemy import Connection, select

from kpred.database.schema import ArrayRow, CategoryRow, DescriptorRow, ModelRow

CONTENT = "content"
"""Name, in a model's metadata, of the hash of its mesh; `kpred database build` writes it."""

MESH = ("faces", "vertices")
"""Arrays of a model's mesh."""


def read_fingerprint(connection: Connection) -> str:
    """Hash ids, categories, weights, metadata, frames, sizes, keypoints and meshes of all models, as 64 digits.

    Metadata hold a hash of the mesh, so that large databases are hashed in seconds; meshes of models without one are
    read. Tokens are left out: they follow from meshes and weights.
    """
    query = (
        select(
            ModelRow.model_id,
            CategoryRow.name,
            CategoryRow.fingerprint,
            ModelRow.id,
            ModelRow.meta,
            ModelRow.frame,
            ModelRow.vertex_count,
            ModelRow.face_count,
            ModelRow.point_count,
            DescriptorRow.keypoints,
        )
        .join(CategoryRow, CategoryRow.id == ModelRow.category_id)
        .join(DescriptorRow, DescriptorRow.model == ModelRow.id)
    )
    rows: dict[int, bytes] = {}
    bare = set()
    for row in connection.execute(query):
        facts = json.dumps([*row[:3], row.meta, *row[6:9]], sort_keys=True).encode()
        rows[row.id] = hashlib.sha256(facts + bytes(row.frame) + bytes(row.keypoints)).digest()
        if not row.meta.get(CONTENT):
            bare.add(row.id)
    for model, mesh in _mesh_hashes(connection, bare).items():
        rows[model] = hashlib.sha256(rows[model] + mesh).digest()
    # Servers sort text by other rules than Python: the order must not matter.
    digest = hashlib.sha256()
    for one in sorted(rows.values()):
        digest.update(one)
    return digest.hexdigest()


def _mesh_hashes(connection: Connection, models: Set[int]) -> dict[int, bytes]:
    """Hash the stored meshes of models, by row."""
    if not models:
        return {}
    found: dict[int, list[bytes]] = {}
    columns = ArrayRow.model, ArrayRow.name, ArrayRow.shape, ArrayRow.step, ArrayRow.codec, ArrayRow.data
    for row in connection.execute(select(*columns).where(ArrayRow.name.in_(MESH))):
        if row.model in models:
            facts = json.dumps([row.name, row.shape, row.step, row.codec]).encode()
            found.setdefault(row.model, []).append(hashlib.sha256(facts + bytes(row.data)).digest())
    return {model: b"".join(sorted(hashes)) for model, hashes in found.items()}
