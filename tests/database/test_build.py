"""Building: killed and resumed gives the same file content; broken meshes are left out and listed."""

import os
import subprocess
import sys
import time
from functools import partial

import numpy as np
import pytest
import torch

from kpred import database as databases
from kpred.database import Database
from kpred.database.connection import create_file
from kpred.errors import DatabaseError
from kpred.fitting.defaults import shared_categories
from kpred.nn import KPRed, Model, ModelConfig, load_model, save_network
from kpred.nn.config import SHARED
from kpred.shapes.mesh import Mesh

COUNT = 11
BROKEN = "m03"
POINTS = 128  # sampled on a model; the real number takes longer and tells no more here
build_database = partial(databases.build_database, count=POINTS)


def shapes():
    """Eleven slanted boxes in turns of chairs and tables; one of them has no area."""
    box = np.array([[0, 1, 2], [0, 2, 3], [4, 6, 5], [4, 7, 6], [0, 4, 5], [0, 5, 1], [1, 5, 6], [1, 6, 2]])
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])
    for i in range(COUNT):
        name = f"m{i:02d}"
        size = np.array([1 + 0.1 * i, 2 - 0.1 * i, 1]) * (name != BROKEN)
        yield name, ("chair", "table")[i % 3 == 2], "source", Mesh(corners * size, box)


@pytest.fixture(scope="module")
def weights(tmp_path_factory):
    folder = tmp_path_factory.mktemp("weights")
    for seed, category in enumerate(("chair", "table")):
        torch.manual_seed(seed)
        config = ModelConfig(category, token_size=8, width=16, stages=1, region_points=8)
        save_network(KPRed(config), folder / category)
    return folder


@pytest.fixture
def model(weights):
    return load_model(weights)


def assert_same_content(left, right, assert_same):
    with Database.open(left) as a, Database.open(right) as b:
        assert a.model_ids() == b.model_ids()
        assert a.info()["categories"] == b.info()["categories"]
        for name in a.model_ids():
            assert_same(a.entry(name), b.entry(name))


def test_a_build_adds_what_it_can_and_lists_the_rest(tmp_path, model):
    path = tmp_path / "a.kpred"
    told = []
    extra = [("m00", "chair", "train", next(shapes())[3]), ("sofa-1", "sofa", "source", next(shapes())[3])]
    report = build_database(path, [*shapes(), *extra], model, batch=4, progress=told.append)
    assert report.added == COUNT - 1
    assert report.skipped_present == 0
    assert [name for name, _ in report.failed] == [BROKEN, "m00", "sofa-1"]
    assert "area" in report.failed[0][1]
    assert "same id" in report.failed[1][1]
    assert "sofa" in report.failed[2][1]
    assert told == sorted(told)
    assert told[-1] == COUNT + 2
    with Database.open(path) as database:
        database.check_model(model)
        assert len(database) == COUNT - 1
        assert database.categories() == ("chair", "table")
        assert database.metadata("m00").items() > {"split": "source"}.items()
        entry = database.entry("m04")
        assert database.search("chair", entry.tokens, top_k=1).model_ids == ("m04",)
    assert [file.name for file in tmp_path.iterdir()] == ["a.kpred"]


def test_a_second_build_adds_only_what_is_new(tmp_path, model, assert_same):
    whole, grown = tmp_path / "whole.kpred", tmp_path / "grown.kpred"
    everything = list(shapes())
    build_database(whole, everything, model, batch=1)
    build_database(grown, everything[:6], model, batch=1)
    report = build_database(grown, everything, model, batch=1)
    assert (report.added, report.skipped_present, len(report.failed)) == (5, 5, 1)
    assert_same_content(whole, grown, assert_same)


KILLED = """
import os, sys
sys.path.insert(0, sys.argv[5])
import numba, torch
numba.set_num_threads(1)
torch.set_num_threads(1)
from test_build import build_database, shapes
from kpred.nn import load_model

limit = int(sys.argv[3])
def progress(handled):
    if handled >= limit:
        os.kill(os.getpid(), 9)

build_database(sys.argv[1], shapes(), load_model(sys.argv[2]), batch=int(sys.argv[4]), progress=progress)
"""


def test_a_killed_build_goes_on_where_it_stopped(tmp_path, weights, model, assert_same, request):
    whole, killed = tmp_path / "whole.kpred", tmp_path / "killed.kpred"
    build_database(whole, shapes(), model, batch=2)
    for limit in (4, 7):  # killed, killed again
        command = [sys.executable, "-c", KILLED, str(killed), str(weights), str(limit), "2", str(request.path.parent)]
        assert subprocess.run(command, check=False).returncode == -9
    with Database.open(killed) as database:
        done = len(database)
    assert 0 < done < COUNT - 1
    report = build_database(killed, shapes(), model, batch=2)
    assert report.skipped_present == done
    assert report.added == COUNT - 1 - done
    assert [name for name, _ in report.failed] == [BROKEN]
    assert_same_content(whole, killed, assert_same)


def test_an_interrupted_build_keeps_its_batches_and_its_file_is_whole(tmp_path, model):
    path = tmp_path / "a.kpred"

    def stop(handled):
        if handled >= 5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        build_database(path, shapes(), model, batch=2, progress=stop)
    assert [file.name for file in tmp_path.iterdir()] == ["a.kpred"]
    with Database.open(path) as database:
        assert len(database) == 4


def test_a_build_anew_takes_the_old_one_s_place_only_when_it_is_done(tmp_path, model):
    path = tmp_path / "a.kpred"
    build_database(path, list(shapes())[:2], model)

    def stop(handled):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        build_database(path, shapes(), model, resume=False, progress=stop)
    with Database.open(path) as database:
        assert len(database) == 2
    report = build_database(path, list(shapes())[4:], model, resume=False)
    assert report.skipped_present == 0
    with Database.open(path) as database:
        assert database.model_ids() == tuple(f"m{i:02d}" for i in range(4, COUNT))
    assert [file.name for file in tmp_path.iterdir()] == ["a.kpred"]


def test_several_processes_make_the_same_database(tmp_path, weights, assert_same):
    # The real number of points: what is set in this process does not reach the others.
    networks, some = load_model(weights), list(shapes())[:6]
    one, two = tmp_path / "one.kpred", tmp_path / "two.kpred"
    alone = build_database(one, some, networks, batch=2)
    told = []
    report = build_database(two, some, networks, batch=2, workers=2, progress=told.append)
    assert (report.added, len(report.failed)) == (alone.added, len(alone.failed)) == (5, 1)
    assert told == sorted(told)
    assert told[-1] == 6
    assert_same_content(one, two, assert_same)
    with pytest.raises(DatabaseError, match="at least 1"):
        build_database(two, some, networks, workers=0)


def test_weights_do_not_mix(tmp_path, model):
    path = tmp_path / "a.kpred"
    build_database(path, list(shapes())[:2], model)
    torch.manual_seed(9)
    others = Model("others", {name: KPRed(network.config).eval() for name, network in model.items()})
    before = path.read_bytes()
    with pytest.raises(DatabaseError, match=r"a\.kpred.*other weights"):
        build_database(path, shapes(), others)
    assert path.read_bytes() == before


def test_a_foreign_file_is_not_touched(tmp_path, model):
    path = tmp_path / "notes.txt"
    path.write_text("not a database")
    with pytest.raises(DatabaseError, match=r"notes\.txt"):
        build_database(path, shapes(), model)
    assert path.read_text() == "not a database"


def test_folders_that_killed_builds_left_are_removed_after_a_day(tmp_path):
    for name, age in ((".kpred-old", 90_000), (".kpred-new", 10)):
        (tmp_path / name).mkdir()
        (tmp_path / name / "half.kpred").write_bytes(b"x")
        os.utime(tmp_path / name, (time.time() - age,) * 2)
    Database.create(tmp_path / "a.kpred").close()
    assert {item.name for item in tmp_path.iterdir()} == {".kpred-new", "a.kpred"}


SECOND = """
import os, sys
sys.path.insert(0, sys.argv[3])
import torch
torch.set_num_threads(1)
from test_build import build_database, shapes
from kpred.errors import DatabaseError
from kpred.nn import load_model

try:
    build_database(sys.argv[1], shapes(), load_model(sys.argv[2]), keep_empty=False)
except DatabaseError as error:
    print(error)
"""


def test_a_second_build_of_a_file_is_told_and_takes_nothing_away(tmp_path, weights, model, request):
    path, told = tmp_path / "a.kpred", []

    def second(handled):
        if not told:
            command = [sys.executable, "-c", SECOND, str(path), str(weights), str(request.path.parent)]
            told.append(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
            assert path.exists()

    report = build_database(path, shapes(), model, batch=2, progress=second)
    assert told == [f"Database {path}: another process is building it; wait until that ends and try again.\n"]
    assert report.added == COUNT - 1
    assert [file.name for file in tmp_path.iterdir()] == ["a.kpred"]


def test_of_two_that_make_a_file_one_is_told(tmp_path, model):
    path = tmp_path / "a.kpred"
    build_database(path, shapes(), model)
    with pytest.raises(DatabaseError, match="exists already"):
        create_file(path, "the second, which saw no file before")
    with Database.open(path) as database:
        assert len(database) == COUNT - 1
    assert [file.name for file in tmp_path.iterdir()] == ["a.kpred"]


def test_a_build_of_nothing_leaves_nothing_only_where_it_made_the_file(tmp_path, model):
    build_database(tmp_path / "a.kpred", [], model, keep_empty=False)
    assert list(tmp_path.iterdir()) == []
    build_database(tmp_path / "a.kpred", [], model)
    build_database(tmp_path / "a.kpred", [], model, keep_empty=False)
    assert [file.name for file in tmp_path.iterdir()] == ["a.kpred"]


def test_a_shared_network_encodes_shapes_under_their_own_category(tmp_path, model):
    torch.manual_seed(5)
    shared = KPRed(ModelConfig(SHARED, token_size=8, width=16, stages=1, region_points=8))
    save_network(shared, tmp_path / "mixed" / SHARED)
    save_network(model["table"], tmp_path / "mixed" / "table")
    mixed = load_model(tmp_path / "mixed")
    items = list(shapes())
    chosen = [items[0], ("lamp-1", "lamp", "source", items[1][3]), items[2]]
    report = build_database(tmp_path / "a.kpred", chosen, mixed)
    assert (report.added, report.failed) == (3, [])
    with Database.open(tmp_path / "a.kpred") as database:
        assert database.categories() == ("chair", "lamp", "table")
        made_by = {name: one["fingerprint"] for name, one in database.info()["categories"].items()}
        assert made_by["chair"] == made_by["lamp"] == shared.fingerprint() != made_by["table"]
        database.check_model(mixed)
        with pytest.raises(DatabaseError, match="chair tokens"):
            database.check_model(model)
        assert shared_categories(mixed, database, None) == ["table"], "the ones that the recognizer may know"
        assert shared_categories(mixed, database, "lamp") == ["lamp"]
        alone = load_model(tmp_path / "mixed" / SHARED)
        with pytest.raises(DatabaseError, match="table tokens"):
            shared_categories(alone, database, "lamp")
