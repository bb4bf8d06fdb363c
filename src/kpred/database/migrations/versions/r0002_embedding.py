"""Tokens once more as vectors of pgvector, which an HNSW index finds the nearest of."""

import numpy as np
import sqlalchemy as sa
from alembic import op

revision = "0002"
down_revision = "0001"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Make the table and fill it from the tokens that are there."""
    op.execute("CREATE EXTENSION IF NOT EXISTS vector WITH SCHEMA public")
    op.execute(
        "CREATE TABLE kpred.embedding (model integer PRIMARY KEY REFERENCES kpred.model(id) ON DELETE CASCADE, "
        "category_id integer NOT NULL REFERENCES kpred.category(id), tokens public.vector NOT NULL)"
    )
    op.execute("INSERT INTO kpred.info (key, value) VALUES ('content', gen_random_uuid()::text) ON CONFLICT DO NOTHING")
    op.execute("INSERT INTO kpred.info (key, value) VALUES ('epoch', gen_random_uuid()::text) ON CONFLICT DO NOTHING")
    connection = op.get_bind()
    last = 0
    while True:
        rows = connection.execute(
            sa.text(
                "SELECT m.id, m.category_id, d.tokens FROM kpred.model m JOIN kpred.descriptor d ON d.model = m.id "
                "WHERE m.id > :last ORDER BY m.id LIMIT 500"
            ),
            {"last": last},
        ).all()
        if not rows:
            return
        connection.execute(
            sa.text("INSERT INTO kpred.embedding VALUES (:model, :category, CAST(:tokens AS public.vector))"),
            [{"model": row.id, "category": row.category_id, "tokens": _written(row.tokens)} for row in rows],
        )
        last = rows[-1].id


def _written(tokens: bytes) -> str:
    return f"[{','.join(map(repr, np.frombuffer(tokens, '<f2').astype(float).tolist()))}]"


def downgrade() -> None:
    """Drop the table."""
    op.drop_table("embedding", schema="kpred")
