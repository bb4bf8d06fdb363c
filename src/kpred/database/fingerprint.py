"""Fingerprint of a database's content, by which a record of a fit knows it again."""

from __future__ import annotations

import hashlib
import json

from sqlalchemy import Connection, select

from kpred.database.schema import CategoryRow, DescriptorRow, ModelRow


def read_fingerprint(connection: Connection) -> str:
    """Hash ids, categories, weights, metadata, frames, sizes and keypoints of all models, as 64 hexadecimal digits.

    Meshes and tokens are left out: keypoints follow from a mesh, and large databases are hashed in seconds.
    """
    query = (
        select(
            ModelRow.model_id,
            CategoryRow.name,
            CategoryRow.fingerprint,
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
    rows = []
    for row in connection.execute(query):
        facts = json.dumps([*row[:3], row.meta, *row[5:8]], sort_keys=True).encode()
        rows.append(hashlib.sha256(facts + bytes(row.frame) + bytes(row.keypoints)).digest())
    # Servers sort text by other rules than Python: the order must not matter.
    digest = hashlib.sha256()
    for one in sorted(rows):
        digest.update(one)
    return digest.hexdigest()
