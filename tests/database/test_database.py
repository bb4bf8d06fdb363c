"""The file: round trips, transactions, other processes, and files that are not one of ours."""

import os
import shutil
import sqlite3
import subprocess
import sys
from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from search_reference import reference_search

from kpred.database import Database
from kpred.database.sqlite import SqliteBackend
from kpred.errors import DatabaseError
from kpred.nn import KPRed, Model, ModelConfig


@pytest.fixture
def filled(filled, random_entry):
    """A closed file of six chairs and two tables."""
    with Database.open(filled) as database:
        database.add([random_entry(f"table-{i}", "table", fingerprint="weights-t") for i in range(2)])
    return filled


def only_file(path):
    """The database is one file and nothing else lies beside it."""
    return [file.name for file in path.parent.iterdir()] == [path.name]


@given(
    points=st.integers(1, 40),
    vertices=st.integers(1, 40),
    faces=st.integers(0, 40),
    keypoints=st.integers(1, 14),
    token_size=st.integers(1, 40),
    parts=st.booleans(),
    category=st.text(st.characters(codec="utf-8", exclude_characters="\0"), min_size=1),
)
def test_entries_come_back_to_the_bit(tmp_path_factory, random_entry, assert_same, **sizes):
    path = tmp_path_factory.mktemp("round") / "a b%20#?é.kpred"
    entry = random_entry('one\'s "model" %é', **sizes)
    with Database.create(path) as database:
        assert database.add([entry]) == 1
        assert_same(database.entry(entry.model_id), entry)
    with Database.open(path) as database:
        assert_same(database.entry(entry.model_id), entry)
        assert database.metadata(entry.model_id) == entry.metadata
        assert database.categories() == (sizes["category"],)
    assert only_file(path)


def test_what_the_database_says_about_itself(filled):
    with Database.open(filled) as database:
        assert len(database) == 8
        assert "chair-3" in database
        assert "chair-9" not in database
        assert database.categories() == ("chair", "table")
        assert database.model_ids("table") == ("table-0", "table-1")
        assert len(database.model_ids()) == 8
        info = database.info()
    assert info["models"] == 8
    assert info["bytes"] == filled.stat().st_size
    chair = {"models": 6, "fingerprint": "weights-a", "model_name": "tiny", "keypoints": 12, "token_size": 128}
    assert info["categories"]["chair"] == chair


def test_candidates_are_stacked_in_the_order_asked_for(filled, random_entry, assert_same):
    with Database.open(filled) as database:
        for _ in range(2):  # from the file, then from memory
            found = database.candidates("chair", ["chair-4", "chair-1"])
            assert found.model_ids == ("chair-4", "chair-1")
            for row, name in enumerate(found.model_ids):
                entry = random_entry(name)
                np.testing.assert_array_equal(found.keypoints[row], entry.keypoints)
                np.testing.assert_array_equal(found.points[row], entry.points)
                np.testing.assert_array_equal(found.point_basis[row], entry.point_basis)
                np.testing.assert_array_equal(found.point_parts[row], entry.point_parts)
                np.testing.assert_array_equal(found.point_normals[row], entry.point_normals)
                assert found.point_parts.dtype == np.int16
                structure = found.structures[row]
                assert structure.vertex_parts.shape == structure.facets.shape == (0,)
                whole = replace(structure, vertex_parts=entry.structure.vertex_parts, facets=entry.structure.facets)
                assert_same(replace(entry, structure=whole), entry)
            found.points[:] = 0  # a copy of its own
        assert database.candidates("chair").model_ids == database.model_ids("chair")
        with pytest.raises(DatabaseError, match="chair-99"):
            database.candidates("chair", ["chair-1", "chair-99"])
        with pytest.raises(DatabaseError, match="table-1"):
            database.candidates("chair", ["chair-1", "table-1"])


def test_search_equals_the_reference_and_follows_add_and_remove(filled, random_entry):
    query = random_entry("query").tokens
    weights = np.linspace(0.1, 1, 12).astype(np.float32)

    def check(database, names):
        tokens = np.stack([random_entry(name).tokens for name in sorted(names)])
        wanted = reference_search(tuple(sorted(names)), tokens, query, weights, 4)
        found = database.search("chair", query, weights, 4)
        assert found.model_ids == wanted.model_ids
        np.testing.assert_allclose(found.distances, wanted.distances, rtol=1e-5)

    with Database.open(filled) as database:
        names = {f"chair-{i}" for i in range(6)}
        check(database, names)
        database.add([random_entry(f"new-{i}") for i in range(20)])
        names |= {f"new-{i}" for i in range(20)}
        check(database, names)
        gone = {"chair-2", *database.search("chair", query, weights, 2).model_ids}
        assert database.remove(gone) == len(gone)
        check(database, names - gone)
        with pytest.raises(DatabaseError, match="chair, table"):
            database.search("sofa", query)


def test_another_connection_s_writes_are_seen(filled, random_entry):
    entry = random_entry("newcomer")
    with Database.open(filled) as reader, Database.open(filled) as writer:
        assert reader.search("chair", entry.tokens, top_k=1).distances[0] > 0
        old = reader.candidates("chair", ["chair-1"]).keypoints
        writer.add([entry])
        writer.remove(["chair-1"])
        writer.add([replace(random_entry("chair-1"), keypoints=np.zeros((12, 3), np.float32))])
        assert reader.search("chair", entry.tokens, top_k=1).model_ids == ("newcomer",)
        new = reader.candidates("chair", ["chair-1"]).keypoints
        assert old.any()
        assert not new.any()


def test_an_add_that_fails_adds_nothing(filled, random_entry):
    before = filled.read_bytes()
    bad = {
        "chair-3 already": [random_entry("x"), random_entry("chair-3")],
        "x already": [random_entry("x"), random_entry("x")],
        "weights-b": [random_entry("x"), random_entry("y", fingerprint="weights-b")],
        "shape": [random_entry("x"), random_entry("y", token_size=64)],
        "NaN": [random_entry("x"), replace(random_entry("y"), tokens=np.full((12, 128), np.nan, np.float32))],
    }
    with Database.open(filled) as database:
        for word, entries in bad.items():
            with pytest.raises(DatabaseError, match=word):
                database.add(entries)
            assert len(database) == 8
        with pytest.raises(DatabaseError, match="no model 'nobody'"):
            database.remove(["chair-1", "nobody"])
        assert len(database) == 8
    assert filled.read_bytes() == before


def test_removed_models_leave_nothing_behind_and_free_their_category(filled, random_entry):
    with Database.open(filled) as database:
        database.remove(["table-0", "table-1"])
        assert database.categories() == ("chair",)
        database.add([random_entry("table-0", "table", fingerprint="weights-b")])
        database.remove(["table-0", *database.model_ids("chair")])
        assert len(database) == 0
        assert database.info()["models"] == 0
    with closing(sqlite3.connect(filled)) as connection:
        for table in ("model", "category", "descriptor", "array"):
            assert connection.execute(f"SELECT count(*) FROM {table}").fetchone() == (0,)


def test_other_weights_are_refused(path, random_entry):
    def network(category, seed):
        torch.manual_seed(seed)
        return KPRed(ModelConfig(category, token_size=8, width=16, stages=1))

    chair, table, other = network("chair", 0), network("table", 1), network("table", 2)
    with Database.create(path) as database:
        database.add([random_entry("a", "chair", fingerprint=chair.fingerprint())])
        database.add([random_entry("b", "table", fingerprint=table.fingerprint())])
        database.check_model(Model("right", {"chair": chair, "table": table}))
        database.check_model(chair)
        with pytest.raises(DatabaseError, match=f"{table.fingerprint()}.*{other.fingerprint()}"):
            database.check_model(Model("wrong", {"chair": chair, "table": other}))
        with pytest.raises(DatabaseError, match="sofa"):
            database.check_model(network("sofa", 0))


def test_missing_and_existing_files(path):
    with pytest.raises(DatabaseError, match=r"models\.kpred does not exist.*build"):
        Database.open(path)
    assert not path.exists()
    with pytest.raises(DatabaseError, match="folder"):
        Database.open(path.parent)
    with Database.create(path.parent / "deep" / "er" / "a.kpred") as database:
        assert len(database) == 0
    Database.create(path).close()
    with pytest.raises(DatabaseError, match="exists already"):
        Database.create(path)
    Database.create(path, overwrite=True).close()
    with pytest.raises(DatabaseError, match="closed"):
        len(database)


def test_databases_of_other_programs_and_versions(filled, tmp_path):
    foreign = tmp_path / "foreign.sqlite"
    with closing(sqlite3.connect(foreign)) as connection:
        connection.execute("CREATE TABLE model (id)")
        connection.commit()
    with pytest.raises(DatabaseError, match="another program"):
        Database.open(foreign)
    with closing(sqlite3.connect(filled)) as connection:
        connection.execute("PRAGMA user_version = 99")
    with pytest.raises(DatabaseError, match="99.*upgrade"):
        Database.open(filled)
    with closing(sqlite3.connect(filled)) as connection:
        connection.execute("PRAGMA user_version = 0")
    with pytest.raises(DatabaseError, match="format 0, older.*build it again"):
        Database.open(filled)
    with closing(sqlite3.connect(filled)) as connection:
        connection.execute("PRAGMA user_version = 3")
        connection.execute("DROP TABLE descriptor")
    with pytest.raises(DatabaseError, match="damaged"):
        Database.open(filled)


def test_read_only_files_are_read_and_not_written(filled, random_entry, tmp_path):
    filled.chmod(0o444)
    filled.parent.chmod(0o555)
    try:
        with Database.open(filled, read_only=True) as database:
            assert database.search("chair", random_entry("chair-1").tokens, top_k=1).model_ids == ("chair-1",)
            assert database.entry("chair-1").model_id == "chair-1"
            with pytest.raises(DatabaseError, match="reading only"):
                database.add([random_entry("x")])
        if os.geteuid() != 0:
            with Database.open(filled) as database:
                assert database.read_only
    finally:
        filled.parent.chmod(0o755)
    assert only_file(filled)


def test_a_full_disk_loses_nothing_committed(filled, random_entry, assert_same):
    backend = SqliteBackend(filled, False, 5.0)
    with Database(backend) as database:
        with backend.transaction(write=False) as connection:
            pages = connection.exec_driver_sql("PRAGMA page_count").scalar_one()
            connection.exec_driver_sql(f"PRAGMA max_page_count = {pages + 20}")
        with pytest.raises(DatabaseError, match=r"models\.kpred: the disk is full"):
            database.add([random_entry(f"big-{i}", points=2048) for i in range(4)])
        assert len(database) == 8
        database.remove(["chair-5"])
    with Database.open(filled) as database:
        assert len(database) == 7
        assert_same(database.entry("chair-0"), random_entry("chair-0"))


HOLD = """
import sqlite3, sys
connection = sqlite3.connect(sys.argv[1], isolation_level=None)
connection.execute("BEGIN " + sys.argv[2])
print("held", flush=True)
sys.stdin.read()
"""


def hold(path, kind):
    """Another process that holds a lock until its input ends."""
    command = [sys.executable, "-c", HOLD, str(path), kind]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "held\n"
    return process


def test_locked_by_another_process(filled, random_entry):
    with Database.open(filled, timeout=0.1) as database:
        with hold(filled, "IMMEDIATE"):  # the other writes: reading goes on
            assert len(database.search("chair", random_entry("chair-1").tokens).model_ids) == 6
            with pytest.raises(DatabaseError, match=r"models\.kpred: another process is writing"):
                database.add([random_entry("x")])
        with hold(filled, "EXCLUSIVE"):
            with pytest.raises(DatabaseError, match="another process is writing"):
                database.entry("chair-1")
            with pytest.raises(DatabaseError, match="another process is writing"):
                Database.open(filled, timeout=0.1)
        assert database.add([random_entry("x")]) == 1


def test_a_writer_killed_in_a_transaction_leaves_what_was_committed(filled, random_entry, tmp_path):
    # Enough uncommitted pages that SQLite spills them into the file before the commit.
    script = """
import os, sqlite3, sys
connection = sqlite3.connect(sys.argv[1], isolation_level=None)
connection.execute("PRAGMA cache_size = 5")
connection.execute("BEGIN IMMEDIATE")
connection.execute("UPDATE array SET data = zeroblob(30000)")
connection.execute("DELETE FROM descriptor")
os.kill(os.getpid(), 9)
"""
    killed = subprocess.run([sys.executable, "-c", script, str(filled)], check=False)
    assert killed.returncode == -9
    assert filled.with_name(filled.name + "-journal").exists()
    copy = tmp_path / "copy"
    copy.mkdir()
    for file in filled.parent.glob("models.kpred*"):
        shutil.copy(file, copy)
    with Database.open(filled) as database:
        assert len(database) == 8
        assert database.search("chair", random_entry("chair-1").tokens, top_k=1).model_ids == ("chair-1",)
    assert only_file(filled) or {file.name for file in tmp_path.iterdir()} == {filled.name, "copy"}
    with pytest.raises(DatabaseError, match=r"models\.kpred"):
        Database.open(copy / filled.name, read_only=True)


def test_threads_share_a_database(filled, random_entry):
    from concurrent.futures import ThreadPoolExecutor

    names = [f"chair-{i}" for i in range(6)] * 10
    with Database.open(filled) as database, ThreadPoolExecutor(4) as pool:
        found = pool.map(lambda name: database.search("chair", random_entry(name).tokens, top_k=1).model_ids[0], names)
        assert list(found) == names
        entries = pool.map(database.entry, names)
        assert [entry.model_id for entry in entries] == names


def test_pipes_are_refused_at_once(tmp_path):
    os.mkfifo(tmp_path / "a.kpred")
    with pytest.raises(DatabaseError, match="is a pipe or a device"):
        Database.open(tmp_path / "a.kpred")
