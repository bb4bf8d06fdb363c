"""Structures of meshes in the table `array`: rows alone, which `kpred.database.update` adds in the same transaction."""

revision = "0003"
down_revision = "0002"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Change no table."""


def downgrade() -> None:
    """Change no table: older programs leave rows aside that they do not know."""
