"""What a database and its models say of themselves, for people and programs."""

from __future__ import annotations

from typing import Any

from sqlalchemy import Connection, func, select

from kpred.database.schema import CategoryRow, InfoRow, ModelRow


def read_statistics(connection: Connection) -> dict[str, Any]:
    """Format, maker, number of models; and per category models, weights and sizes, in alphabetical order."""
    counts = select(ModelRow.category_id, func.count().label("models")).group_by(ModelRow.category_id).subquery()
    recorded = {row.key: row.value for row in connection.execute(select(InfoRow))}
    rows = connection.execute(
        select(CategoryRow, counts.c.models)
        .join(counts, counts.c.category_id == CategoryRow.id)
        .order_by(CategoryRow.name)
    ).all()
    return {
        "schema_version": int(recorded["schema_version"]),
        "created_by": recorded["created_by"],
        "models": sum(row.models for row in rows),
        "licences": read_licences(connection),
        "categories": {
            row.name: {
                "models": row.models,
                "fingerprint": row.fingerprint,
                "model_name": row.model_name,
                "keypoints": row.keypoint_count,
                "token_size": row.token_size,
            }
            for row in rows
        },
    }


def read_licences(connection: Connection) -> dict[str, int]:
    """Count the models of each licence; an empty name is of those of which none is known."""
    # A subquery: PostgreSQL does not see that an expression with parameters is the one that it groups by.
    names = select(ModelRow.meta["licence"].as_string().label("licence")).subquery()
    found = connection.execute(select(names.c.licence, func.count()).group_by(names.c.licence)).all()
    return {str(name or ""): int(count) for name, count in sorted(found, key=lambda row: row[0] or "")}


def read_metadata(connection: Connection, category: str | None = None) -> dict[str, dict[str, Any]]:
    """Read the metadata of all models, or of one category, by id, with `category` and the counts of the mesh."""
    query = select(ModelRow.model_id, ModelRow.meta, ModelRow.vertex_count, ModelRow.face_count, CategoryRow.name)
    query = query.join(CategoryRow, CategoryRow.id == ModelRow.category_id)
    if category is not None:
        query = query.where(CategoryRow.name == category)
    found = sorted(connection.execute(query).all(), key=lambda row: str(row.model_id))
    return {
        row.model_id: {**row.meta, "category": row.name, "vertices": row.vertex_count, "faces": row.face_count}
        for row in found
    }
