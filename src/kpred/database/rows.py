"""From rows to entries and arrays, inside a transaction of the caller."""

from __future__ import annotations

import secrets
import zipfile
import zlib
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from sqlalchemy import Connection, Select, delete, func, select, update

from kpred.database.arrays import DamagedArray, unpack_array
from kpred.database.curve_coding import CODECS, unpack_along_curve
from kpred.database.entry import APPEARANCE, Entry, unpack_frame
from kpred.database.schema import ArrayRow, CategoryRow, DescriptorRow, InfoRow, ModelRow
from kpred.database.structure_arrays import FITTING_STRUCTURE, check_point_structure, unpack_structure
from kpred.errors import MeshError
from kpred.ops.typing import Float, Int
from kpred.shapes.appearance.appearance import Appearance
from kpred.shapes.mesh import Mesh
from kpred.shapes.structure import Structure

_CHUNK = 500
"""Values in one SQL `IN` list; old builds of SQLite allow 999."""

_FITTING = ("points", "point_basis", "point_parts", "point_normals", *FITTING_STRUCTURE)
"""Arrays that fitting reads."""

Value = TypeVar("Value")


@dataclass(frozen=True, eq=False)
class FittingArrays:
    """What fitting needs of one model of K keypoints and N points, float32, unit box.

    Attributes:
        point_parts: (N,) int16, part of each point; point_normals: (N, 3), away from the middle of the part's box.
        scale: half the longest side of the model's box, in its own unit.
        structure: without the arrays of vertices and faces, which are empty.
    """

    category: str
    keypoints: Float[np.ndarray, "keypoints 3"]
    points: Float[np.ndarray, "points 3"]
    point_basis: Float[np.ndarray, "points keypoints"]
    point_parts: Int[np.ndarray, " points"]
    point_normals: Float[np.ndarray, "points 3"]
    structure: Structure
    scale: float


def read_category_names(connection: Connection) -> tuple[str, ...]:
    """Return the names of all categories, sorted."""
    return tuple(connection.scalars(select(CategoryRow.name).order_by(CategoryRow.name)))


def read_entries(connection: Connection, model_ids: Sequence[str]) -> dict[str, Entry]:
    """Return model id -> entry; ids that are not in the database are left out."""
    found = {name: _read_entry(connection, name) for name in model_ids}
    return {name: entry for name, entry in found.items() if entry is not None}


def _read_entry(connection: Connection, model_id: str) -> Entry | None:
    row = connection.execute(
        select(ModelRow.id, ModelRow.meta, ModelRow.frame, DescriptorRow.keypoints, DescriptorRow.tokens)
        .add_columns(CategoryRow.name, CategoryRow.fingerprint, CategoryRow.keypoint_count, CategoryRow.token_size)
        .join(CategoryRow, CategoryRow.id == ModelRow.category_id)
        .join(DescriptorRow, DescriptorRow.model == ModelRow.id)
        .where(ModelRow.model_id == model_id)
    ).one_or_none()
    if row is None:
        return None
    arrays = read_arrays(connection, {row.id: model_id}, without=(APPEARANCE,))[row.id]
    with of_model(model_id):
        return _entry(model_id, row, arrays)


def read_appearance(connection: Connection, model_id: str) -> Appearance | None:
    """Read what a model's file held beside positions; None where nothing was kept, or the model is not there."""
    rows = find_rows(connection, [model_id])
    if model_id not in rows:
        return None
    arrays = read_arrays(connection, {rows[model_id]: model_id}, (APPEARANCE,))[rows[model_id]]
    if APPEARANCE not in arrays:
        return None
    with of_model(model_id):
        try:
            return Appearance.unpack(arrays[APPEARANCE].astype(np.uint8).tobytes())
        except (ValueError, KeyError, OSError, zipfile.BadZipFile, zlib.error) as error:
            raise DamagedArray(f"its {APPEARANCE} cannot be unpacked") from error


def _entry(model_id: str, row: Any, arrays: dict[str, np.ndarray]) -> Entry:
    """Build an entry from its columns and arrays; raises DamagedArray."""
    structure = unpack_structure(arrays, len(arrays["vertices"]), len(arrays["faces"]))
    check_point_structure(arrays["point_parts"], arrays["point_normals"], len(arrays["points"]), structure.parts)
    return Entry(
        model_id=model_id,
        category=row.name,
        mesh=Mesh(arrays["vertices"], arrays["faces"], model_id, arrays.get("face_parts")),
        frame=unpack_frame(row.frame),
        metadata=dict(row.meta),
        points=arrays["points"],
        keypoints=_floats([row.keypoints], "<f4", row.keypoint_count, 3)[0].astype(np.float32),
        tokens=_floats([row.tokens], "<f2", row.keypoint_count, row.token_size)[0].astype(np.float32),
        point_basis=arrays["point_basis"],
        vertex_basis=arrays["vertex_basis"],
        structure=structure,
        point_parts=arrays["point_parts"],
        point_normals=arrays["point_normals"],
        fingerprint=row.fingerprint,
    )


@dataclass(frozen=True)
class CategoryTokens:
    """How many tokens of one category there are, and of which shape.

    Attributes:
        category: name; number: its row; fingerprint: of the weights that made the tokens.
        models: number of its models; last_row: greatest row number among them.
    """

    category: str
    number: int
    fingerprint: str
    keypoints: int
    token_size: int
    models: int
    last_row: int


def count_tokens(connection: Connection, category: str) -> CategoryTokens | None:
    """Count the tokens of one category, or return None when there is no such category."""
    row = connection.execute(select(CategoryRow).where(CategoryRow.name == category)).one_or_none()
    if row is None:
        return None
    counts = select(func.count(), func.max(ModelRow.id)).where(ModelRow.category_id == row.id)
    models, last = connection.execute(counts).one()
    return CategoryTokens(row.name, row.id, row.fingerprint, row.keypoint_count, row.token_size, models, last or 0)


def read_tokens(
    connection: Connection, counted: CategoryTokens, after: int = 0
) -> tuple[tuple[str, ...], Float[np.ndarray, "models keypoints token_size"]]:
    """Read ids in ascending order and tokens (M, K, C) float32 of a category, in rows after `after`."""
    found = connection.execute(_tokens(counted, after)).all()
    # Sorted here: two databases need not agree on the order of letters.
    found = sorted(found, key=lambda item: str(item.model_id))
    tokens = _floats([item.tokens for item in found], "<f2", counted.keypoints, counted.token_size)
    return tuple(item.model_id for item in found), tokens.astype(np.float32)


def stream_tokens(
    connection: Connection, counted: CategoryTokens, part: int = 4096
) -> Iterator[tuple[list[str], np.ndarray]]:
    """Yield ids and tokens (n, K, C) float16 of a category, `part` models at a time, in insertion order."""
    found = connection.execution_options(stream_results=True, max_row_buffer=part).execute(_tokens(counted))
    for rows in found.partitions(part):
        tokens = _floats([row.tokens for row in rows], "<f2", counted.keypoints, counted.token_size)
        yield [str(row.model_id) for row in rows], tokens


def _tokens(counted: CategoryTokens, after: int = 0) -> Select[str, bytes]:
    return (
        select(ModelRow.model_id, DescriptorRow.tokens)
        .join(DescriptorRow, DescriptorRow.model == ModelRow.id)
        .where(ModelRow.category_id == counted.number, ModelRow.id > after)
        .order_by(ModelRow.id)
    )


def read_epoch(connection: Connection) -> str | None:
    """Read the value that changes with every removal; None in a damaged file without it."""
    found = connection.scalar(select(InfoRow.value).where(InfoRow.key == "epoch"))
    return None if found is None else str(found)


def delete_rows(connection: Connection, rows: Sequence[int]) -> None:
    """Delete models by row, and categories that have none then; changes the epoch, which outdates token files."""
    for chunk in chunks(rows):
        connection.execute(delete(ModelRow).where(ModelRow.id.in_(chunk)))
    used = select(ModelRow.category_id)
    connection.execute(delete(CategoryRow).where(CategoryRow.id.not_in(used)))
    connection.execute(update(InfoRow).where(InfoRow.key == "epoch").values(value=new_epoch()))


def new_epoch() -> str:
    """Return a new random value."""
    return secrets.token_hex(16)


def read_fitting_arrays(connection: Connection, model_ids: Sequence[str]) -> dict[str, FittingArrays]:
    """Read arrays for fitting by model id; ids that are not in the database are left out."""
    found = {}
    for chunk in chunks(model_ids):
        rows = connection.execute(
            select(ModelRow.id, ModelRow.model_id, CategoryRow.name, CategoryRow.keypoint_count)
            .add_columns(ModelRow.frame, DescriptorRow.keypoints)
            .join(CategoryRow, CategoryRow.id == ModelRow.category_id)
            .join(DescriptorRow, DescriptorRow.model == ModelRow.id)
            .where(ModelRow.model_id.in_(chunk))
        ).all()
        arrays = read_arrays(connection, {row.id: row.model_id for row in rows}, _FITTING)
        for row in rows:
            with of_model(row.model_id):
                keypoints = _floats([row.keypoints], "<f4", row.keypoint_count, 3)[0].astype(np.float32)
                scale = unpack_frame(row.frame).scale
                found[row.model_id] = _fitting_arrays(row.name, keypoints, scale, arrays[row.id])
    return found


def _fitting_arrays(category: str, keypoints: np.ndarray, scale: float, arrays: dict[str, np.ndarray]) -> FittingArrays:
    structure, count = unpack_structure(arrays), len(arrays["points"])
    shapes = {name: arrays[name].shape for name in ("points", "point_basis")}
    if shapes != {"points": (count, 3), "point_basis": (count, len(keypoints))}:
        raise DamagedArray(f"points and point_basis have shapes {shapes['points']} and {shapes['point_basis']}")
    check_point_structure(arrays["point_parts"], arrays["point_normals"], count, structure.parts)
    return FittingArrays(
        category=category,
        keypoints=keypoints,
        points=arrays["points"],
        point_basis=arrays["point_basis"],
        point_parts=arrays["point_parts"],
        point_normals=arrays["point_normals"],
        structure=structure,
        scale=scale,
    )


def find_rows(connection: Connection, model_ids: Sequence[str]) -> dict[str, int]:
    """Find row numbers by model id; ids that are not in the database are left out."""
    rows: dict[str, int] = {}
    for chunk in chunks(model_ids):
        found = connection.execute(select(ModelRow.model_id, ModelRow.id).where(ModelRow.model_id.in_(chunk)))
        rows |= {row.model_id: row.id for row in found}
    return rows


def chunks(values: Sequence[Value]) -> Iterator[list[Value]]:
    """Split `values` into lists short enough for one SQL `IN`."""
    for start in range(0, len(values), _CHUNK):
        yield list(values[start : start + _CHUNK])


def read_arrays(
    connection: Connection,
    models: Mapping[int, str],
    names: Collection[str] | None = None,
    without: Collection[str] = (),
) -> dict[int, dict[str, np.ndarray]]:
    """Read arrays (all, or those of `names`) of models {row: id}, as row -> name -> array.

    Raises:
        DamagedArray: the bytes of one make up no array; it names the model.
    """
    columns = (ArrayRow.name, ArrayRow.dtype, ArrayRow.shape, ArrayRow.step, ArrayRow.codec, ArrayRow.data)
    query = select(ArrayRow.model, *columns).where(ArrayRow.model.in_(list(models)))
    if names is not None:
        query = query.where(ArrayRow.name.in_(names))
    if without:
        query = query.where(ArrayRow.name.not_in(without))
    arrays: dict[int, dict[str, np.ndarray]] = {model: {} for model in models}
    along_curve = []
    for model, name, dtype, shape, step, codec, data in connection.execute(query):
        if codec in CODECS:
            along_curve.append((model, name, dtype, shape, step, codec, data))
            continue
        with of_model(models[model]):
            arrays[model][name] = unpack_array(dtype, shape, step, codec, data)
    for model, name, dtype, shape, step, codec, data in along_curve:
        with of_model(models[model]):
            places = arrays[model]["points" if name == "point_basis" else "vertices"]
            arrays[model][name] = unpack_along_curve(dtype, shape, step, codec, data, places)
    return arrays


@contextmanager
def of_model(model_id: str) -> Iterator[None]:
    """Name the model in what is raised about its arrays; a missing one is damage too."""
    try:
        yield
    except DamagedArray as error:
        raise DamagedArray(f"model {model_id}: {error}") from error
    except MeshError as error:
        raise DamagedArray(str(error)) from error
    except KeyError as error:
        raise DamagedArray(f"model {model_id}: {error.args[0]} is missing") from error


def _floats(blobs: Sequence[bytes], dtype: str, *shape: int) -> np.ndarray:
    try:
        return np.frombuffer(b"".join(blobs), dtype=dtype).reshape(len(blobs), *shape)
    except ValueError as error:
        raise DamagedArray(f"{len(blobs)} blobs are no {dtype} arrays of shape {shape}") from error
