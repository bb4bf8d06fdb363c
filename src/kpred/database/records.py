"""A model as it is stored: its rows, byte by byte, which are the same in every kind of database."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from sqlalchemy import Connection, insert, select, text
from sqlalchemy.exc import IntegrityError

from kpred.database.backend import Added
from kpred.database.entry import Entry, pack_arrays, pack_frame
from kpred.database.schema import ArrayRow, CategoryRow, DescriptorRow, ModelRow
from kpred.errors import DatabaseError
from kpred.ops.typing import Float

_CATEGORY = ("fingerprint", "model_name", "keypoint_count", "token_size")
_MODEL = ("meta", "frame", "vertex_count", "face_count", "point_count")
_DESCRIPTOR = ("keypoints", "tokens")
_ARRAY = ("name", "dtype", "shape", "step", "codec", "data")


@dataclass(frozen=True)
class ModelRecord:
    """The rows of one model without their numbers; the names are those of `kpred.database.schema`."""

    model_id: str
    category: str
    weights: dict[str, Any]
    model: dict[str, Any]
    descriptor: dict[str, bytes]
    arrays: tuple[dict[str, Any], ...]

    def tokens(self) -> Float[np.ndarray, "keypoints token_size"]:
        """Return the tokens (K, C) float16."""
        shape = (self.weights["keypoint_count"], self.weights["token_size"])
        return np.frombuffer(self.descriptor["tokens"], "<f2").reshape(shape)

    def digest(self) -> str:
        """Hash the stored values, except for the weights' name."""
        weights = {key: value for key, value in self.weights.items() if key != "model_name"}
        total = hashlib.sha256()
        for part in (self.model_id, self.category, weights, self.model, self.descriptor, *self.arrays):
            ordered = sorted(part.items()) if isinstance(part, dict) else part
            total.update(repr(ordered).encode("utf-8", "surrogatepass"))
        return total.hexdigest()


def make_record(entry: Entry, model_name: str) -> ModelRecord:
    """Turn an entry into its record; `model_name`: of the model whose weights encoded it."""
    count, size = entry.tokens.shape
    return ModelRecord(
        entry.model_id,
        entry.category,
        {"fingerprint": entry.fingerprint, "model_name": model_name, "keypoint_count": count, "token_size": size},
        {
            "meta": dict(entry.metadata),
            "frame": pack_frame(entry.frame),
            "vertex_count": len(entry.mesh.vertices),
            "face_count": len(entry.mesh.faces),
            "point_count": len(entry.points),
        },
        {
            "keypoints": np.asarray(entry.keypoints).astype("<f4").tobytes(),
            "tokens": np.asarray(entry.tokens).astype("<f2").tobytes(),
        },
        tuple({"name": name, **columns} for name, columns in pack_arrays(entry).items()),
    )


def read_records(connection: Connection, model_ids: Sequence[str]) -> dict[str, ModelRecord]:
    """Read records by model id; ids that are not in the database are left out."""
    found = connection.execute(
        select(ModelRow.id, ModelRow.model_id, *(getattr(ModelRow, name) for name in _MODEL))
        .add_columns(CategoryRow.name.label("category"), *(getattr(CategoryRow, name) for name in _CATEGORY))
        .add_columns(*(getattr(DescriptorRow, name) for name in _DESCRIPTOR))
        .join(CategoryRow, CategoryRow.id == ModelRow.category_id)
        .join(DescriptorRow, DescriptorRow.model == ModelRow.id)
        .where(ModelRow.model_id.in_(list(model_ids)))
    ).all()
    arrays: dict[int, list[dict[str, Any]]] = {row.id: [] for row in found}
    query = select(ArrayRow).where(ArrayRow.model.in_(list(arrays))).order_by(ArrayRow.model, ArrayRow.name)
    for row in connection.execute(query):
        arrays[row.model].append({name: getattr(row, name) for name in _ARRAY})

    def columns(row: Any, names: Sequence[str]) -> dict[str, Any]:
        return {name: getattr(row, name) for name in names}

    return {
        row.model_id: ModelRecord(
            row.model_id,
            row.category,
            columns(row, _CATEGORY),
            columns(row, _MODEL),
            columns(row, _DESCRIPTOR),
            tuple(sorted(arrays[row.id], key=lambda array: str(array["name"]))),
        )
        for row in found
    }


def insert_records(connection: Connection, models: Sequence[ModelRecord], path: str) -> list[Added]:
    """Insert models, and the categories of which they are the first; `path`: of the database, for messages.

    Raises DatabaseError: an id is taken, or the category's tokens are of other weights or another shape.
    """
    try:
        return [_insert(connection, model) for model in models]
    except DatabaseError as error:
        raise DatabaseError(f"Database {path}: {error}") from error


def _insert(connection: Connection, model: ModelRecord) -> Added:
    category = _category(connection, model)
    try:
        made = connection.execute(insert(ModelRow).values(model_id=model.model_id, category_id=category, **model.model))
    except IntegrityError as error:
        raise DatabaseError(
            f"it holds {model.model_id} already; remove it first, or give the new one another id."
        ) from error
    key = made.inserted_primary_key
    assert key is not None
    number = int(key[0])
    connection.execute(insert(DescriptorRow).values(model=number, **model.descriptor))
    connection.execute(insert(ArrayRow), [{"model": number, **columns} for columns in model.arrays])
    return Added(number, category, model.tokens())


def _category(connection: Connection, model: ModelRecord) -> int:
    query = select(CategoryRow).where(CategoryRow.name == model.category)
    row = connection.execute(query).one_or_none()
    if row is None:
        values = {"name": model.category, **model.weights}
        # Another who writes on a server may have made it meanwhile.
        marks = ", ".join(f":{name}" for name in values)
        statement = f"INSERT INTO category ({', '.join(values)}) VALUES ({marks}) ON CONFLICT (name) DO NOTHING"
        connection.execute(text(statement), values)
        row = connection.execute(query).one()
    fingerprint, count, size = (model.weights[name] for name in ("fingerprint", "keypoint_count", "token_size"))
    if fingerprint != row.fingerprint:
        raise DatabaseError(
            f"its {row.name} tokens were made by weights {row.fingerprint or 'unnamed'}, {model.model_id} was encoded "
            f"by {fingerprint or 'unnamed'}; encode it with the same model, or build the database again."
        )
    if (count, size) != (row.keypoint_count, row.token_size):
        raise DatabaseError(
            f"its {row.name} tokens have shape ({row.keypoint_count}, {row.token_size}), {model.model_id} has "
            f"({count}, {size}); encode it with the same model."
        )
    return int(row.id)
