"""What a database says of itself, for people and programs."""

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
