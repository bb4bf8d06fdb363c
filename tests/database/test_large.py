"""A category of many models: the token file is made, trusted, extended and made anew as the database changes."""

import shutil

import numpy as np
import pytest
from search_reference import reference_search

from kpred.database import Database
from kpred.database.token_file import open_table

MANY = 20


@pytest.fixture
def path(tmp_path, random_entry):
    file = tmp_path / "many.kpred"
    with Database.create(file, index_from=MANY) as database:
        database.add([random_entry(f"c{i:03d}") for i in range(40)])
        database.add([random_entry(f"t{i:03d}", "table") for i in range(5)])
    return file


def check(database, random_entry, names, query="query"):
    tokens = np.stack([random_entry(name).tokens for name in names])
    weights = np.linspace(0.1, 1, 12).astype(np.float32)
    wanted = reference_search(tuple(names), tokens, random_entry(query).tokens, weights)
    found = database.search("chair", random_entry(query).tokens, weights)
    assert found.model_ids == wanted.model_ids
    np.testing.assert_array_equal(found.distances, wanted.distances)
    assert database.model_ids("chair") == tuple(sorted(names))


def token_file(path):
    return path.with_name(f"{path.name}.tokens-1")


def test_the_token_file_follows_the_database(path, random_entry):
    names = [f"c{i:03d}" for i in range(40)]
    with (
        Database.open(path, index_from=MANY) as database,
        Database.open(path, read_only=True, index_from=MANY) as reader,
    ):
        check(database, random_entry, names)
        first = token_file(path).stat()
        check(reader, random_entry, names)
        database.add([random_entry("late-1"), random_entry("late-2")])
        names += ["late-1", "late-2"]
        for one in (database, reader):
            check(one, random_entry, names)
            check(one, random_entry, names, query="late-2")
        assert token_file(path).stat().st_ino == first.st_ino  # few came later: it is still of use
        assert database.remove(["c007", "late-1"]) == 2
        names = [name for name in names if name not in ("c007", "late-1")]
        for one in (database, reader):
            check(one, random_entry, names)
        assert token_file(path).stat().st_ino != first.st_ino
        assert len(open_table(token_file(path))) == 40
        database.add([random_entry(f"more-{i}") for i in range(20)])
        check(database, random_entry, names + [f"more-{i}" for i in range(20)])
        assert len(open_table(token_file(path))) == 60
    assert {file.name for file in path.parent.iterdir()} == {path.name, token_file(path).name}


def test_a_removed_and_replaced_model_is_not_taken_from_the_old_file(path, random_entry):
    with Database.open(path, index_from=MANY) as database:
        database.prepare_search()
        # The last row's number is given again to the next model.
        database.remove(["c039"])
        database.add([random_entry("new")])
        check(database, random_entry, [f"c{i:03d}" for i in range(39)] + ["new"], query="new")


def test_the_token_file_of_another_database_or_a_damaged_one_is_not_used(path, random_entry, tmp_path):
    other = tmp_path / "other" / "many.kpred"
    with Database.create(other, index_from=MANY) as database:
        database.add([random_entry(f"c{i:03d}", seed=9) for i in range(40)])
        database.prepare_search()
    names = [f"c{i:03d}" for i in range(40)]
    shutil.copy(token_file(other), token_file(path))
    with Database.open(path, index_from=MANY) as database:
        check(database, random_entry, names)
    for content in (b"", b"KPRDTOK1{}", token_file(path).read_bytes()[:5000]):
        token_file(path).write_bytes(content)
        with Database.open(path, index_from=MANY) as database:
            check(database, random_entry, names)
    whole = open_table(token_file(path))
    assert len(whole) == 40


def test_where_no_file_can_be_written_tokens_stay_in_memory(path, random_entry):
    token_file(path).mkdir()  # a folder is in the way
    names = [f"c{i:03d}" for i in range(40)]
    with Database.open(path, index_from=MANY) as database:
        with pytest.warns(UserWarning, match="tokens-1.*kept in memory"):
            check(database, random_entry, names)
        database.add([random_entry("late")])
        check(database, random_entry, [*names, "late"])  # no second warning: the table in memory is still of use
