"""Bringing a database of an older format up to date: the structure of every mesh is computed and stored."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
from sqlalchemy import Connection, insert, select, update

from kpred.database.address import is_address
from kpred.database.arrays import DamagedArray, on_grid
from kpred.database.backend import Progress
from kpred.database.connection import OLDEST, explained, open_file
from kpred.database.encode import DEFAULT_SEED, prepare_mesh, to_unit_box
from kpred.database.entry import POINT_STEP, unpack_frame
from kpred.database.point_faces import faces_of_points
from kpred.database.postgres import PostgresBackend
from kpred.database.postgres_schema import is_current, upgrade_tables
from kpred.database.rows import of_model, read_arrays
from kpred.database.schema import SCHEMA_VERSION, ArrayRow, InfoRow, ModelRow
from kpred.database.structure_arrays import check_structure, pack_structure
from kpred.database.surface import analyse_surface
from kpred.ops.frames import Frame
from kpred.shapes.mesh import Mesh


def update_database(path: str | os.PathLike[str], *, progress: Progress | None = None, timeout: float = 5.0) -> int:
    """Bring a database up to date in one transaction and return the number of models updated; 0 if it is.

    A process that is stopped on the way leaves it as it was. Tokens, keypoints, points and bases stay to the bit.

    Args:
        path: the file or the server's address.
        progress: called with the number of models that are done, and of all.
        timeout: seconds to wait while another process writes.

    Raises:
        DatabaseError: it cannot be read or written, is newer than this program, or a model is damaged.
    """
    if is_address(path):
        return _update_server(path, progress, timeout)
    return _update_file(Path(path), progress, timeout)


def _update_file(path: Path, progress: Progress | None, timeout: float) -> int:
    engine = open_file(path, False, timeout, oldest=OLDEST)
    try:
        with (
            explained(path),
            engine.connect().execution_options(kpred_write=True) as connection,
            connection.begin(),
        ):
            if int(connection.exec_driver_sql("PRAGMA user_version").scalar_one()) == SCHEMA_VERSION:
                return 0
            updated = _add_structures(connection, progress)
            version = update(InfoRow).where(InfoRow.key == "schema_version").values(value=str(SCHEMA_VERSION))
            connection.execute(version)
            connection.exec_driver_sql(f"PRAGMA user_version = {SCHEMA_VERSION}")
            return updated
    finally:
        engine.dispose()


def _update_server(address: str | os.PathLike[str], progress: Progress | None, timeout: float) -> int:
    backend = PostgresBackend(address, False, timeout, check=False)
    try:
        with backend.transaction(write=False) as connection:
            if is_current(connection, str(backend.path)):
                return 0
        with backend.transaction(write=True, exclusive=True) as connection:
            return _add_structures(connection, progress) if upgrade_tables(connection, str(backend.path)) else 0
    finally:
        backend.close()


def _add_structures(connection: Connection, progress: Progress | None) -> int:
    """Compute and store the structures of all models, and return their number."""
    models = connection.execute(select(ModelRow.id, ModelRow.model_id, ModelRow.frame).order_by(ModelRow.id)).all()
    for done, row in enumerate(models, 1):
        arrays = read_arrays(connection, {row.id: row.model_id}, ("vertices", "faces", "points"))[row.id]
        with of_model(row.model_id):
            mesh = Mesh(arrays["vertices"], arrays["faces"], row.model_id)
            packed = _packed_structure(mesh, unpack_frame(row.frame), arrays["points"])
        connection.execute(insert(ArrayRow), [{"model": row.id, "name": name, **packed[name]} for name in packed])
        if progress is not None:
            progress(done, len(models))
    return len(models)


def _packed_structure(mesh: Mesh, frame: Frame, stored_points: np.ndarray) -> dict[str, dict[str, Any]]:
    """Name -> columns of the arrays that older formats lack."""
    vertices = to_unit_box(mesh, frame)
    if not (len(mesh.faces) and np.isfinite(vertices).all() and np.isfinite(stored_points).all()):
        raise DamagedArray("its mesh or its points are damaged")
    points, point_faces = _sample(mesh, vertices, stored_points)
    found = analyse_surface(vertices, mesh.faces, points, point_faces)
    check_structure(found.structure, len(vertices), len(mesh.faces))
    return pack_structure(found.structure, found.point_parts, found.point_normals)


def _sample(mesh: Mesh, vertices: np.ndarray, stored_points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return points (N, 3) and their faces, sampled again with the usual seed or located by position."""
    drawn = prepare_mesh(mesh, mesh.name, DEFAULT_SEED)
    unchanged = np.array_equal(drawn.mesh.faces, mesh.faces)
    if unchanged and np.array_equal(on_grid(drawn.points.numpy(), POINT_STEP), stored_points):
        return drawn.points.numpy(), drawn.point_faces.numpy()
    return stored_points, faces_of_points(stored_points, vertices, mesh.faces)
