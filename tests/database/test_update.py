"""Databases of older formats: refused with the mend, updated to what a build makes, and left whole when stopped."""

import sqlite3
import subprocess
import sys
from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest
import torch

from kpred.database import Database, encode_models, update_database
from kpred.database.arrays import pack_array
from kpred.database.point_faces import faces_of_points
from kpred.errors import DatabaseError
from kpred.nn import KPRed, ModelConfig
from kpred.synthetic.generator import generate

MODELS = 4


def network():
    torch.manual_seed(0)
    config = ModelConfig("table", token_size=8, width=16, stages=1, region_points=8)
    return KPRed(config).eval().requires_grad_(False)


@pytest.fixture(scope="module", params=[0, 7])
def entries(request):
    """Tables as a build encodes them, with the usual seed and with another one."""
    pack = generate("table", MODELS, seed=1, splits=False)
    meshes, names = [pack[i] for i in range(MODELS)], [f"t{i}" for i in range(MODELS)]
    return encode_models(meshes, names, network(), seed=request.param)


def make_old(path, version):
    """A file of this format as an older program has written it: without structures."""
    with closing(sqlite3.connect(path)) as connection:
        connection.execute("DELETE FROM array WHERE name LIKE 'structure.%' OR name IN ('point_parts','point_normals')")
        connection.execute("UPDATE info SET value = ? WHERE key = 'schema_version'", (str(version),))
        connection.execute(f"PRAGMA user_version = {version}")
        connection.commit()


@pytest.fixture
def built(tmp_path, entries):
    file = tmp_path / "tables.kpred"
    with Database.create(file) as database:
        database.add(entries)
    return file


@pytest.fixture
def old(built):
    make_old(built, 2)
    return built, 2


def assert_as_built(database, entries, assert_same):
    """To the bit with the usual seed; with another one but for points where parts touch, whose face is ambiguous."""
    again = encode_models([entries[0].mesh], [entries[0].model_id], network(), seed=0)[0]
    usual = np.array_equal(again.points, entries[0].points)
    for entry in entries:
        found = database.entry(entry.model_id)
        if usual:
            assert_same(found, entry)
            continue
        contacts = {name: getattr(entry.structure, name) for name in ("contact_parts", "contact_points")}
        assert (found.point_parts == entry.point_parts).mean() > 0.9
        assert (np.abs(found.point_normals - entry.point_normals).max(axis=1) < 0.01).mean() > 0.9
        rest = replace(found, point_parts=entry.point_parts, point_normals=entry.point_normals)
        assert_same(replace(rest, structure=replace(found.structure, **contacts)), entry)


def test_older_formats_are_refused_and_updated(old, entries, assert_same):
    path, version = old
    before = path.read_bytes()
    for read_only in (True, False, None):
        with pytest.raises(DatabaseError, match=rf"tables\.kpred has format {version}.*kpred database update .*tables"):
            Database.open(path, read_only=read_only)
    assert path.read_bytes() == before
    told = []
    assert update_database(path, progress=lambda done, total: told.append((done, total))) == MODELS
    assert told == [(done, MODELS) for done in range(1, MODELS + 1)]
    assert [file.name for file in path.parent.iterdir()] == [path.name]
    after = path.read_bytes()
    assert update_database(path) == 0
    assert path.read_bytes() == after
    with Database.open(path) as database:
        assert database.info()["schema_version"] == 3
        assert_as_built(database, entries, assert_same)
        database.candidates("table")
        database.add([replace(entries[0], model_id="new")])
        database.remove(["t1"])


def test_the_first_format_is_refused(built):
    make_old(built, 1)
    for work in (Database.open, update_database):
        with pytest.raises(DatabaseError, match="format 1, older than format 2, the oldest known here; build it again"):
            work(built)


KILLED = """
import os, sys
from kpred.database import update_database
def progress(done, total):
    if done == 3:
        os.kill(os.getpid(), 9)
update_database(sys.argv[1], progress=progress)
"""


def content(path):
    with closing(sqlite3.connect(path)) as connection:
        return list(connection.iterdump())


def test_a_killed_update_leaves_the_old_database(old, entries, assert_same):
    path, version = old
    before = content(path)
    assert subprocess.run([sys.executable, "-c", KILLED, str(path)], check=False).returncode == -9
    assert content(path) == before
    with pytest.raises(DatabaseError, match=f"format {version}"):
        Database.open(path)

    def stop(done, total):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        update_database(path, progress=stop)
    assert content(path) == before
    assert update_database(path) == MODELS
    with Database.open(path) as database:
        assert_as_built(database, entries, assert_same)


@pytest.mark.parametrize("damage", ["cut", "nan", "missing"])
def test_a_damaged_model_is_named_and_nothing_is_changed(built, damage):
    make_old(built, 2)
    nan = pack_array(np.full((2048, 3), np.nan), "<f4")["data"]
    statement = {
        "cut": "UPDATE array SET data = substr(data, 5)",
        "nan": "UPDATE array SET dtype = '<f4', step = NULL, codec = ?, data = ?",
        "missing": "DELETE FROM array",
    }[damage]
    values = (pack_array(np.full((2048, 3), np.nan), "<f4")["codec"], nan) if damage == "nan" else ()
    where = " WHERE name = 'points' AND model = (SELECT id FROM model WHERE model_id = 't2')"
    with closing(sqlite3.connect(built)) as connection:
        connection.execute(statement + where, values)
        connection.commit()
    before = content(built)
    with pytest.raises(DatabaseError, match=r"tables\.kpred: model t2: .*damaged"):
        update_database(built)
    assert content(built) == before


def test_places_that_cannot_be_updated(tmp_path, built):
    make_old(built, 2)
    with pytest.raises(DatabaseError, match="does not exist"):
        update_database(tmp_path / "none.kpred")
    (tmp_path / "notes.txt").write_text("not a database")
    with pytest.raises(DatabaseError, match="not a kpred database"):
        update_database(tmp_path / "notes.txt")
    with closing(sqlite3.connect(built)) as connection:
        connection.execute("PRAGMA user_version = 99")
    with pytest.raises(DatabaseError, match="99.*upgrade"):
        update_database(built)


def test_points_find_the_face_they_were_sampled_on(rng):
    vertices = rng.normal(size=(60, 3))
    faces = rng.integers(0, 60, (200, 3))
    faces = faces[(faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 0] != faces[:, 2])]
    wanted = rng.integers(0, len(faces), 500)
    weights = rng.dirichlet([4.0, 4.0, 4.0], 500)
    points = np.einsum("pk,pkj->pj", weights, vertices[faces[wanted]])
    corners = np.sort(faces, axis=1)
    # Other faces through the same point are as near; of one face there may be two copies.
    found = faces_of_points(points, vertices, faces)
    assert (corners[found] == corners[wanted]).all(axis=1).mean() > 0.98
    normals = np.cross(*(vertices[faces[found, k]] - vertices[faces[found, 0]] for k in (1, 2)))
    off = np.einsum("pj,pj->p", normals, points - vertices[faces[found, 0]]) / np.linalg.norm(normals, axis=1)
    assert np.abs(off).max() < 1e-4


def test_points_off_the_surface_find_the_nearest_face(rng):
    low = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], float)
    vertices = np.concatenate([low, low + [0, 0, 1]])
    faces = np.array([[0, 1, 2], [3, 5, 4]])
    points = rng.uniform([-3, -3, -3], [3, 3, 4], (300, 3))
    found = faces_of_points(points, vertices, faces)
    np.testing.assert_array_equal(found, (points[:, 2] > 0.5).astype(int))
