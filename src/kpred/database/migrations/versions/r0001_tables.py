"""The tables of the database file, on a server."""

import sqlalchemy as sa
from alembic import op

revision = "0001"
down_revision = None
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Make the tables; ids compare by code point, as Python compares them."""
    words = sa.Text(collation="C")
    model = sa.ForeignKey("kpred.model.id", ondelete="CASCADE")
    op.create_table(
        "info", sa.Column("key", sa.Text, primary_key=True), sa.Column("value", sa.Text, nullable=False), schema="kpred"
    )
    op.create_table(
        "category",
        sa.Column("id", sa.Integer, primary_key=True),
        sa.Column("name", words, nullable=False, unique=True),
        sa.Column("fingerprint", sa.Text, nullable=False),
        sa.Column("model_name", sa.Text, nullable=False),
        sa.Column("keypoint_count", sa.Integer, nullable=False),
        sa.Column("token_size", sa.Integer, nullable=False),
        schema="kpred",
    )
    op.create_table(
        "model",
        sa.Column("id", sa.Integer, primary_key=True),
        sa.Column("model_id", words, nullable=False, unique=True),
        sa.Column("category_id", sa.Integer, sa.ForeignKey("kpred.category.id"), nullable=False, index=True),
        sa.Column("meta", sa.JSON, nullable=False),
        sa.Column("frame", sa.LargeBinary, nullable=False),
        sa.Column("vertex_count", sa.Integer, nullable=False),
        sa.Column("face_count", sa.Integer, nullable=False),
        sa.Column("point_count", sa.Integer, nullable=False),
        schema="kpred",
    )
    op.create_table(
        "descriptor",
        sa.Column("model", sa.Integer, model, primary_key=True),
        sa.Column("keypoints", sa.LargeBinary, nullable=False),
        sa.Column("tokens", sa.LargeBinary, nullable=False),
        schema="kpred",
    )
    op.create_table(
        "array",
        sa.Column("model", sa.Integer, sa.ForeignKey("kpred.model.id", ondelete="CASCADE"), primary_key=True),
        sa.Column("name", sa.Text, primary_key=True),
        sa.Column("dtype", sa.Text, nullable=False),
        sa.Column("shape", sa.Text, nullable=False),
        sa.Column("step", sa.Double),
        sa.Column("codec", sa.Text, nullable=False),
        sa.Column("data", sa.LargeBinary, nullable=False),
        schema="kpred",
    )
    # The arrays are compressed already.
    op.execute('ALTER TABLE kpred."array" ALTER COLUMN data SET STORAGE EXTERNAL')
    op.execute("ALTER TABLE kpred.descriptor ALTER COLUMN tokens SET STORAGE EXTERNAL")


def downgrade() -> None:
    """Drop all tables."""
    for name in ("array", "descriptor", "model", "category", "info"):
        op.drop_table(name, schema="kpred")
