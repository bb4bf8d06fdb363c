"""A real server: the same class, the same answers; several writers; a server that is restarted; older tables."""

import subprocess
import sys
import threading
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest
from search_reference import reference_search

from kpred.database import Database, update_database
from kpred.database.build import open_or_create
from kpred.database.postgres import PostgresBackend
from kpred.errors import DatabaseError

ADDED = ("structure", "point_parts", "point_normals")
"""What format 3 added to an entry."""


@contextmanager
def own_transaction(address):
    """A writing transaction of a connection beside the database's."""
    backend = PostgresBackend(address, False, 5.0)
    with backend.transaction(write=True) as connection:
        yield connection
    backend.close()


def check_search(database, random_entry, names, **sizes):
    tokens = np.stack([random_entry(name, **sizes).tokens for name in names])
    query, weights = random_entry("query").tokens, np.linspace(0.1, 1, 12).astype(np.float32)
    wanted = reference_search(tuple(names), tokens, query, weights, 4)
    found = database.search("chair", query, weights, 4)
    assert found.model_ids == wanted.model_ids
    np.testing.assert_array_equal(found.distances, wanted.distances)


def test_the_same_answers_as_a_file(address, random_entry, assert_same, tmp_path):
    entries = [random_entry(f"c{i}é'\"%:x") for i in range(6)] + [random_entry("t", "table", parts=True)]
    entries.append(random_entry("Z"))  # before c by code point, after it in many languages
    with pytest.raises(DatabaseError, match="holds no kpred database.*build"):
        Database.open(address)
    assert not Database.exists(address)
    with Database.create(address) as server, Database.create(tmp_path / "a.kpred") as file:
        assert Database.exists(address)
        for database in (server, file):
            assert database.add(entries, model_name="tiny") == 8
        for entry in entries:
            assert_same(server.entry(entry.model_id), entry)
            assert_same(file.entry(entry.model_id), entry)
            assert server.metadata(entry.model_id) == entry.metadata
        assert server.model_ids() == file.model_ids()
        assert server.model_ids("chair") == file.model_ids("chair")
        assert server.categories() == ("chair", "table")
        assert server.info()["categories"] == file.info()["categories"]
        assert server.info()["licences"] == file.info()["licences"]
        assert server.all_metadata() == file.all_metadata()
        assert server.info()["bytes"] > 0
        check_search(server, random_entry, ["Z", *(f"c{i}é'\"%:x" for i in range(6))])
        left, right = server.candidates("chair"), file.candidates("chair")
        np.testing.assert_array_equal(left.points, right.points)
        np.testing.assert_array_equal(left.point_basis, right.point_basis)
        np.testing.assert_array_equal(left.point_parts, right.point_parts)
        np.testing.assert_array_equal(left.point_normals, right.point_normals)
        for one, other in zip(left.structures, right.structures, strict=True):
            np.testing.assert_array_equal(one.axes, other.axes)
        assert server.remove(["t", "Z"]) == 2
        assert server.categories() == ("chair",)
        assert "Z" not in server
        with pytest.raises(DatabaseError, match="holds Z already|holds c0"):
            server.add([random_entry("new"), entries[0]])
        assert len(server) == 6
        with pytest.raises(DatabaseError, match="weights-b"):
            server.add([random_entry("x", fingerprint="weights-b")])
    with pytest.raises(DatabaseError, match="exists already"):
        Database.create(address)
    with Database.open(address, read_only=True) as server, pytest.raises(DatabaseError, match="reading only"):
        server.add([random_entry("x")])


def test_very_many_models_are_found_by_the_server_s_index(address, random_entry):
    names = [f"m{i:03d}" for i in range(300)]
    small = {"points": 4, "vertices": 4, "faces": 2}
    with Database.create(address, index_from=20) as database:
        for start in range(0, 300, 100):
            database.add([random_entry(name, **small) for name in names[start : start + 100]])
        database.prepare_search()
        with own_transaction(address) as connection:
            indices = connection.exec_driver_sql("SELECT indexdef FROM pg_indexes WHERE schemaname = 'kpred'").scalars()
            assert any("hnsw" in line and "vector_l1_ops" in line for line in indices)
        check_search(database, random_entry, names, **small)
        assert database.model_ids("chair") == tuple(names)
        entry = random_entry("later")
        database.add([entry])
        assert database.search("chair", entry.tokens, top_k=1).model_ids == ("later",)
        database.remove(["later"])
        assert database.search("chair", entry.tokens, top_k=1).model_ids != ("later",)


def test_several_write_at_once_and_all_see_all(address, random_entry):
    Database.create(address).close()
    problems = []

    def write(number):
        try:
            with Database.open(address) as database:
                for i in range(5):
                    database.add([random_entry(f"w{number}-{i}")])
        except Exception as error:
            problems.append(error)

    with Database.open(address) as reader:
        threads = [threading.Thread(target=write, args=(number,)) for number in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert problems == []
        names = sorted(f"w{number}-{i}" for number in range(4) for i in range(5))
        assert reader.model_ids() == tuple(names)
        check_search(reader, random_entry, names)


def test_a_server_that_is_restarted_is_waited_for(server, address, random_entry):
    with Database.create(address) as database:
        for i in range(6):
            if i in (2, 4):
                server.stop()
                timer = threading.Timer(0.5, server.ensure_postgres_running)
                timer.start()
            database.add([random_entry(f"m{i}")])
            if i in (2, 4):
                timer.join()
        check_search(database, random_entry, [f"m{i}" for i in range(6)])
        server.stop()
        try:
            with pytest.raises(DatabaseError, match="cannot be reached"):
                Database.open(address, timeout=1.0)
        finally:
            server.ensure_postgres_running()
        assert len(database) == 6


KILLED = """
import os, sys
sys.path.insert(0, sys.argv[2])
from conftest import random_entry
from kpred.database import Database
from kpred.database.postgres import PostgresBackend
from kpred.database.records import insert_records, make_record
with Database.open(sys.argv[1]) as database:
    database.add([random_entry("kept")])
    with PostgresBackend(sys.argv[1], False, 5.0).transaction(write=True) as connection:
        insert_records(connection, [make_record(random_entry("lost"), "")], "")
        os.kill(os.getpid(), 9)
"""


def test_a_writer_that_is_killed_leaves_what_it_had_committed(address, random_entry, request):
    with Database.create(address) as database:
        command = [sys.executable, "-c", KILLED, address, str(request.path.parent)]
        assert subprocess.run(command, check=False).returncode == -9
        assert database.model_ids() == ("kept",)
        database.add([random_entry("lost")])  # its lock is gone too
        check_search(database, random_entry, ["kept", "lost"])


def test_older_tables_are_refused_and_updated_and_newer_ones_refused(address, random_entry, assert_same):
    names = ["a", "b", "c"]
    with Database.create(address) as database:
        database.add([random_entry(name) for name in names])
        with own_transaction(address) as connection:
            connection.exec_driver_sql("DROP TABLE embedding")
            connection.exec_driver_sql(
                "DELETE FROM \"array\" WHERE name LIKE 'structure.%%' OR name IN ('point_parts', 'point_normals')"
            )
            connection.exec_driver_sql("UPDATE kpred_version SET version_num = '0001'")

    def stop(done, total):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        update_database(address, progress=stop)
    for read_only in (True, False):
        with pytest.raises(DatabaseError, match="0001, older.*kpred database update postgresql:"):
            Database.open(address, read_only=read_only)
    assert update_database(address) == len(names)
    assert update_database(address) == 0
    with Database.open(address) as database:
        check_search(database, random_entry, names)
        database.add([random_entry("d")])
        with own_transaction(address) as connection:
            assert connection.exec_driver_sql("SELECT count(*) FROM embedding").scalar_one() == 4
        assert database.info()["schema_version"] == 3
        for name in names:
            entry = database.entry(name)
            entry.check()
            assert_same(replace(random_entry(name), **{field: getattr(entry, field) for field in ADDED}), entry)
        with own_transaction(address) as connection:
            connection.exec_driver_sql("UPDATE kpred_version SET version_num = '9999'")
    for use in (Database.open, update_database):
        with pytest.raises(DatabaseError, match="9999, newer.*upgrade"):
            use(address)


def test_a_server_without_tables_is_not_updated(address):
    with pytest.raises(DatabaseError, match="holds no kpred database"):
        update_database(address)


def test_addresses_that_lead_nowhere(server):
    with pytest.raises(DatabaseError, match="no database of that name|cannot be reached"):
        Database.open(server.get_uri(database="nothing"))
    with pytest.raises(DatabaseError, match="cannot be reached"):
        Database.open("postgresql://nobody:secret@localhost:1/x", timeout=1.0)
    with pytest.raises(DatabaseError) as caught:
        Database.open("postgresql://nobody:secret@localhost:1/x", timeout=1.0)
    assert "secret" not in str(caught.value)


def test_two_first_builds_share_the_tables(address, random_entry):
    """Neither finds tables; one makes them, the other waits and uses them."""
    barrier, errors = threading.Barrier(2), []

    def first_build(number):
        barrier.wait()
        try:
            with open_or_create(address, exists=False) as database:
                database.add([random_entry(f"c{number}-{row}") for row in range(3)], model_name="tiny")
        except DatabaseError as error:
            errors.append(str(error))

    threads = [threading.Thread(target=first_build, args=(number,)) for number in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert errors == []
    with Database.open(address) as database:
        assert len(database) == 6
