"""Tables of the database file.

Search reads `descriptor` alone (a few kilobytes a model); meshes, points and bases lie in `array`, one row an array,
and are read for the few models that are fitted.
"""

from __future__ import annotations

from sqlalchemy import JSON, ForeignKey, LargeBinary
from sqlalchemy.orm import DeclarativeBase, Mapped, mapped_column

APPLICATION_ID = 0x4B505244
"""`PRAGMA application_id` of a kpred database ("KPRD")."""

SCHEMA_VERSION = 3
"""`PRAGMA user_version`: raised when a table or its content changes. Format 2 had no structure of meshes in
`array`; `kpred.database.update` brings it up to date."""


class Base(DeclarativeBase):
    """Root of the tables."""


class InfoRow(Base):
    """Facts about all of it: `schema_version`, `created_by` (version of kpred), `epoch` (new after each removal)."""

    __tablename__ = "info"

    key: Mapped[str] = mapped_column(primary_key=True)
    value: Mapped[str]


class CategoryRow(Base):
    """A category and the weights that made the tokens of all its models."""

    __tablename__ = "category"

    id: Mapped[int] = mapped_column(primary_key=True)
    name: Mapped[str] = mapped_column(unique=True)
    fingerprint: Mapped[str]
    model_name: Mapped[str]
    keypoint_count: Mapped[int]
    token_size: Mapped[int]


class ModelRow(Base):
    """A CAD model: identity, metadata, unit-box frame (13 float64) and counts."""

    __tablename__ = "model"

    id: Mapped[int] = mapped_column(primary_key=True)
    model_id: Mapped[str] = mapped_column(unique=True)
    category_id: Mapped[int] = mapped_column(ForeignKey("category.id"), index=True)
    meta: Mapped[dict[str, str]] = mapped_column(JSON)
    frame: Mapped[bytes] = mapped_column(LargeBinary)
    vertex_count: Mapped[int]
    face_count: Mapped[int]
    point_count: Mapped[int]


class DescriptorRow(Base):
    """What retrieval reads: keypoints (K, 3) as float32, tokens (K, C) as float16, both little-endian."""

    __tablename__ = "descriptor"

    model: Mapped[int] = mapped_column(ForeignKey("model.id", ondelete="CASCADE"), primary_key=True)
    keypoints: Mapped[bytes] = mapped_column(LargeBinary)
    tokens: Mapped[bytes] = mapped_column(LargeBinary)


class ArrayRow(Base):
    """One array of a model, with what is needed to read it back (see `entry.pack_array`)."""

    __tablename__ = "array"

    model: Mapped[int] = mapped_column(ForeignKey("model.id", ondelete="CASCADE"), primary_key=True)
    name: Mapped[str] = mapped_column(primary_key=True)
    dtype: Mapped[str]
    shape: Mapped[str]
    step: Mapped[float | None]
    codec: Mapped[str]
    data: Mapped[bytes] = mapped_column(LargeBinary)
