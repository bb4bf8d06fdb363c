"""From entries to rows and back, inside a transaction of the caller."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from sqlalchemy import Connection, CursorResult, insert, select
from sqlalchemy.exc import IntegrityError

from kpred.database.entry import DamagedArray, Entry, pack_arrays, pack_frame, unpack_array, unpack_frame
from kpred.database.schema import ArrayRow, CategoryRow, DescriptorRow, ModelRow
from kpred.errors import DatabaseError
from kpred.shapes.mesh import Mesh

_CHUNK = 500
"""Values in one SQL `IN` list; old builds of SQLite allow 999."""

Value = TypeVar("Value")


@dataclass(frozen=True, eq=False)
class FittingArrays:
    """What fitting needs of one model: keypoints (K, 3), points (N, 3), point_basis (N, K), float32, unit box."""

    category: str
    keypoints: np.ndarray
    points: np.ndarray
    point_basis: np.ndarray


def insert_entry(connection: Connection, entry: Entry, model_name: str) -> None:
    """Add one entry, and its category where it is the first of it.

    Raises DatabaseError: the id is taken, or the category's tokens are of other weights or another shape.
    """
    category = _category(connection, entry, model_name)
    try:
        made = connection.execute(
            insert(ModelRow).values(
                model_id=entry.model_id,
                category_id=category,
                meta=dict(entry.metadata),
                frame=pack_frame(entry.frame),
                vertex_count=len(entry.mesh.vertices),
                face_count=len(entry.mesh.faces),
                point_count=len(entry.points),
            )
        )
    except IntegrityError as error:
        raise DatabaseError(
            f"it holds {entry.model_id} already; remove it first, or give the new one another id."
        ) from error
    number = _key(made)
    connection.execute(
        insert(DescriptorRow).values(
            model=number,
            keypoints=np.asarray(entry.keypoints).astype("<f4").tobytes(),
            tokens=np.asarray(entry.tokens).astype("<f2").tobytes(),
        )
    )
    rows = [{"model": number, "name": name, **columns} for name, columns in pack_arrays(entry).items()]
    connection.execute(insert(ArrayRow), rows)


def read_entry(connection: Connection, model_id: str) -> Entry | None:
    """All of one model, or None when there is no such id."""
    row = connection.execute(
        select(ModelRow.id, ModelRow.meta, ModelRow.frame, DescriptorRow.keypoints, DescriptorRow.tokens)
        .add_columns(CategoryRow.name, CategoryRow.fingerprint, CategoryRow.keypoint_count, CategoryRow.token_size)
        .join(CategoryRow, CategoryRow.id == ModelRow.category_id)
        .join(DescriptorRow, DescriptorRow.model == ModelRow.id)
        .where(ModelRow.model_id == model_id)
    ).one_or_none()
    if row is None:
        return None
    arrays = _read_arrays(connection, [row.id])[row.id]
    return Entry(
        model_id=model_id,
        category=row.name,
        mesh=Mesh(arrays["vertices"], arrays["faces"], model_id, arrays.get("face_parts")),
        frame=unpack_frame(row.frame),
        metadata=dict(row.meta),
        points=arrays["points"],
        keypoints=_floats([row.keypoints], "<f4", row.keypoint_count, 3)[0],
        tokens=_floats([row.tokens], "<f2", row.keypoint_count, row.token_size)[0],
        point_basis=arrays["point_basis"],
        vertex_basis=arrays["vertex_basis"],
        fingerprint=row.fingerprint,
    )


def read_tokens(connection: Connection, category: str) -> tuple[tuple[str, ...], np.ndarray] | None:
    """Ids in ascending order and tokens (M, K, C) float32 of one category, or None when there is no such category."""
    row = connection.execute(select(CategoryRow).where(CategoryRow.name == category)).one_or_none()
    if row is None:
        return None
    found = connection.execute(
        select(ModelRow.model_id, DescriptorRow.tokens)
        .join(DescriptorRow, DescriptorRow.model == ModelRow.id)
        .where(ModelRow.category_id == row.id)
        .order_by(ModelRow.model_id)
    ).all()
    tokens = _floats([item.tokens for item in found], "<f2", row.keypoint_count, row.token_size)
    return tuple(item.model_id for item in found), tokens


def read_fitting_arrays(connection: Connection, model_ids: Sequence[str]) -> dict[str, FittingArrays]:
    """Model id -> arrays for fitting; ids that are not in the database are left out."""
    found = {}
    for chunk in chunks(model_ids):
        rows = connection.execute(
            select(ModelRow.id, ModelRow.model_id, CategoryRow.name, CategoryRow.keypoint_count)
            .add_columns(DescriptorRow.keypoints)
            .join(CategoryRow, CategoryRow.id == ModelRow.category_id)
            .join(DescriptorRow, DescriptorRow.model == ModelRow.id)
            .where(ModelRow.model_id.in_(chunk))
        ).all()
        arrays = _read_arrays(connection, [row.id for row in rows], ("points", "point_basis"))
        for row in rows:
            keypoints = _floats([row.keypoints], "<f4", row.keypoint_count, 3)[0]
            found[row.model_id] = FittingArrays(row.name, keypoints, **arrays[row.id])
    return found


def find_rows(connection: Connection, model_ids: Sequence[str]) -> dict[str, int]:
    """Model id -> row number; ids that are not in the database are left out."""
    rows: dict[str, int] = {}
    for chunk in chunks(model_ids):
        found = connection.execute(select(ModelRow.model_id, ModelRow.id).where(ModelRow.model_id.in_(chunk)))
        rows |= {row.model_id: row.id for row in found}
    return rows


def chunks(values: Sequence[Value]) -> Iterator[list[Value]]:
    """`values` in lists short enough for one SQL `IN`."""
    for start in range(0, len(values), _CHUNK):
        yield list(values[start : start + _CHUNK])


def _category(connection: Connection, entry: Entry, model_name: str) -> int:
    row = connection.execute(select(CategoryRow).where(CategoryRow.name == entry.category)).one_or_none()
    count, size = entry.tokens.shape
    if row is None:
        columns = {"name": entry.category, "fingerprint": entry.fingerprint, "model_name": model_name}
        made = connection.execute(insert(CategoryRow).values(**columns, keypoint_count=count, token_size=size))
        return _key(made)
    if entry.fingerprint != row.fingerprint:
        raise DatabaseError(
            f"its {row.name} tokens were made by weights {row.fingerprint or 'unnamed'}, {entry.model_id} was encoded "
            f"by {entry.fingerprint or 'unnamed'}; encode it with the same model, or build the database again."
        )
    if (count, size) != (row.keypoint_count, row.token_size):
        raise DatabaseError(
            f"its {row.name} tokens have shape ({row.keypoint_count}, {row.token_size}), {entry.model_id} has "
            f"({count}, {size}); encode it with the same model."
        )
    return int(row.id)


def _key(made: CursorResult[Any]) -> int:
    key = made.inserted_primary_key
    assert key is not None
    return int(key[0])


def _read_arrays(
    connection: Connection, models: list[int], names: Collection[str] | None = None
) -> dict[int, dict[str, np.ndarray]]:
    query = select(ArrayRow).where(ArrayRow.model.in_(models))
    if names is not None:
        query = query.where(ArrayRow.name.in_(names))
    arrays: dict[int, dict[str, np.ndarray]] = {model: {} for model in models}
    for row in connection.execute(query):
        arrays[row.model][row.name] = unpack_array(row.dtype, row.shape, row.step, row.codec, row.data)
    return arrays


def _floats(blobs: Sequence[bytes], dtype: str, *shape: int) -> np.ndarray:
    try:
        return np.frombuffer(b"".join(blobs), dtype=dtype).reshape(len(blobs), *shape).astype(np.float32)
    except ValueError as error:
        raise DamagedArray(f"{len(blobs)} blobs are no {dtype} arrays of shape {shape}") from error
