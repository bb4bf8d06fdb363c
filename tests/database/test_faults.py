"""Real faults: processes killed in a copy and in making a token file, two writers on one file, a disk that is full."""

import json
import os
import shutil
import subprocess
import sys
import textwrap
import time

import numpy as np
import pytest
import torch
from search_reference import reference_search

from kpred.database import Database, copy_database
from kpred.database.token_file import open_table
from kpred.errors import DatabaseError
from kpred.nn import KPRed, ModelConfig, save_network

COUNT = 40


def names():
    return [f"c{i:03d}" for i in range(COUNT)]


@pytest.fixture
def path(tmp_path, random_entry):
    file = tmp_path / "many.kpred"
    with Database.create(file) as database:
        database.add([random_entry(name) for name in names()], model_name="tiny")
        database.add([random_entry("t", "table", parts=True)])
    return file


def python(code, *words, prefix=(), **options):
    """A process of its own that runs `code`, which finds this folder's conftest."""
    start = f"import os, sys\nsys.path.insert(0, {os.path.dirname(__file__)!r})\n"
    command = [*prefix, sys.executable, "-c", start + textwrap.dedent(code), *map(str, words)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **options)


def assert_same_content(left, right):
    with Database.open(left) as a, Database.open(right) as b:
        assert a.model_ids() == b.model_ids()
        assert a.info()["categories"] == b.info()["categories"]
        everything = a.model_ids()
        assert [m.digest() for m in a.records(everything)] == [m.digest() for m in b.records(everything)]


KILLED_COPY = """
    from kpred.database import copy_database
    def progress(what, done, total):
        if what == "copying" and done >= int(sys.argv[3]):
            os.kill(os.getpid(), 9)
    copy_database(sys.argv[1], sys.argv[2], batch=4, progress=progress)
"""


@pytest.fixture(params=["file to file", "file to server", "server to file"])
def places(request, path, tmp_path):
    """Where to copy from and to; the database is at the first."""
    other = tmp_path / "copy.kpred"
    if request.param == "file to file":
        yield path, other
        return
    address = request.getfixturevalue("address")
    if request.param == "file to server":
        yield path, address
    else:
        copy_database(path, address)
        yield address, other


def test_a_killed_copy_goes_on_and_is_verified(places, path, random_entry):
    source, target = places
    assert python(KILLED_COPY, source, target, 10).wait() == -9
    with Database.open(target) as database:
        done = len(database)
    assert 10 <= done < COUNT
    report = copy_database(source, target, batch=7)
    assert (report.copied, report.present, report.verified) == (COUNT + 1 - done, done, COUNT + 1)
    assert_same_content(path, target)
    with Database.open(target) as database:
        database.remove(["c003"])
        database.add([random_entry("c003", seed=5)])
    with pytest.raises(DatabaseError, match="c003 is not that of"):
        copy_database(source, target)


def test_a_copy_to_itself_and_of_other_weights_is_refused(path, tmp_path, random_entry):
    with pytest.raises(DatabaseError, match="onto itself"):
        copy_database(path, path)
    with Database.create(tmp_path / "b.kpred") as database:
        database.add([random_entry("x", fingerprint="weights-b")])
    with pytest.raises(DatabaseError, match="weights-b"):
        copy_database(path, tmp_path / "b.kpred")


KILLED_TABLE = """
    from kpred.database import Database, token_file
    fill = token_file._fill
    def killed(*arguments):
        fill(*arguments)
        os.kill(os.getpid(), 9)
    token_file._fill = killed
    with Database.open(sys.argv[1], index_from=20) as database:
        database.prepare_search()
"""


def test_killed_while_making_a_token_file(path, random_entry):
    assert python(KILLED_TABLE, path).wait() == -9
    left = [file for file in path.parent.iterdir() if file != path]
    assert [file.name.startswith(".many.kpred.") for file in left] == [True]
    os.utime(left[0], (1, 1))  # an hour later
    with Database.open(path, index_from=20) as database:
        tokens = np.stack([random_entry(name).tokens for name in names()])
        query = random_entry("query").tokens
        wanted = reference_search(tuple(names()), tokens, query)
        assert database.search("chair", query).model_ids == wanted.model_ids
    assert {file.name for file in path.parent.iterdir()} == {path.name, f"{path.name}.tokens-1"}


WRITER = """
    import time
    from conftest import random_entry
    from kpred.database import Database
    with Database.open(sys.argv[1], timeout=60.0) as database:
        print("ready", flush=True)
        sys.stdin.readline()
        for i in range(15):
            database.add([random_entry(f"{sys.argv[2]}{i}")])
            if i == 9:
                database.remove([f"{sys.argv[2]}0"])
"""


def test_two_write_to_one_file(path, random_entry, assert_same):
    writers = [python(WRITER, path, word, stdin=subprocess.PIPE) for word in ("left", "right")]
    for writer in writers:
        assert writer.stdout.readline() == "ready\n"
    for writer in writers:
        writer.stdin.write("go\n")
        writer.stdin.flush()
    for writer in writers:
        _, problem = writer.communicate(timeout=120)
        assert writer.returncode == 0, problem
    wanted = {"t", *names(), *(f"{word}{i}" for word in ("left", "right") for i in range(1, 15))}
    with Database.open(path) as database:
        assert set(database.model_ids()) == wanted
        for name in ("left14", "right7", "c001"):
            assert_same(database.entry(name), random_entry(name))


FULL = """
    import json, shutil, subprocess, warnings
    from kpred.database import Database, copy_database
    from kpred.database import sqlite as sqlite_backend
    from kpred.errors import DatabaseError
    source, disk = sys.argv[1:]
    subprocess.run(["mount", "-t", "tmpfs", "-o", "size=200k", "tmpfs", disk], check=True)
    answers = {}
    try:
        copy_database(source, disk + "/copy.kpred", batch=4)
    except DatabaseError as error:
        answers["copy"] = str(error)
    with Database.open(disk + "/copy.kpred", index_from=5) as database:
        answers["kept"] = len(database)
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            query = database.entry("c001").tokens
            answers["found"] = database.search("chair", query, top_k=1).model_ids
        answers["told"] = [str(one.message) for one in told]
    answers["left"] = sorted(os.listdir(disk))
    subprocess.run(["mount", "-o", "remount,size=9m", disk], check=True)
    report = copy_database(source, disk + "/copy.kpred", batch=4)
    answers["then"] = [report.present, report.copied, report.verified]
    print(json.dumps(answers))
"""


def test_a_disk_that_is_full(path, tmp_path):
    if shutil.which("unshare") is None:
        pytest.skip("no unshare")
    disk = tmp_path / "disk"
    disk.mkdir()
    process = python(FULL, path, disk, prefix=("unshare", "-rm"))
    out, problem = process.communicate(timeout=120)
    if "Operation not permitted" in problem or "permission denied" in problem:
        pytest.skip("no file system may be mounted here")
    assert process.returncode == 0, problem
    answers = json.loads(out)
    assert "copy.kpred: the disk is full; free some space and run the same again" in answers["copy"]
    assert 0 < answers["kept"] < COUNT
    assert answers["found"] == ["c001"]
    assert "No space left" in answers["told"][0]
    assert "kept in memory" in answers["told"][0]
    assert answers["left"] == ["copy.kpred"]
    assert answers["then"] == [answers["kept"], COUNT + 1 - answers["kept"], COUNT + 1]


BUILD = """
    import numba, torch
    numba.set_num_threads(1)
    torch.set_num_threads(1)
    from test_build import build_database, shapes
    from kpred.nn import load_model
    def progress(handled):
        print(handled, flush=True)
        if handled == 5:
            sys.stdin.readline()
    print(build_database(sys.argv[1], shapes(), load_model(sys.argv[2]), batch=2, progress=progress), flush=True)
"""


def test_the_server_is_restarted_in_the_middle_of_a_build(server, address, tmp_path):
    for seed, category in enumerate(("chair", "table")):
        torch.manual_seed(seed)
        save_network(
            KPRed(ModelConfig(category, token_size=8, width=16, stages=1, region_points=8)), tmp_path / "m" / category
        )
    whole = python(BUILD, tmp_path / "whole.kpred", tmp_path / "m", stdin=subprocess.PIPE)
    build = python(BUILD, address, tmp_path / "m", stdin=subprocess.PIPE)
    for line in build.stdout:
        if line.strip() == "5":
            break
    server.stop()
    try:
        build.stdin.write("\n")
        build.stdin.flush()
        time.sleep(1.0)
        assert build.poll() is None
    finally:
        server.ensure_postgres_running()
    _, problem = build.communicate(timeout=200)
    assert build.returncode == 0, problem
    whole.communicate("\n", timeout=200)
    assert_same_content(tmp_path / "whole.kpred", address)


def test_the_token_file_s_own_names_do_not_clash(path):
    with Database.open(path, index_from=1) as database:
        database.prepare_search()
    kinds = {open_table(path.with_name(f"{path.name}.tokens-{number}")).key.category for number in (1, 2)}
    assert kinds == {"chair", "table"}
