"""Files that are damaged: refused in one sentence that names the file, and the model where one is to blame."""

import sqlite3
import zlib
from contextlib import closing

import numpy as np
import pytest

from kpred.database import Database
from kpred.database.arrays import DamagedArray, inflate, pack_array, unpack_array
from kpred.errors import DatabaseError


@pytest.mark.parametrize("content", [b"", b"solid cube", bytes(5000), b"SQLite format 3\0", b"SQLite format 3\0" * 500])
def test_files_that_are_no_database(path, content):
    path.write_bytes(content)
    with pytest.raises(DatabaseError, match=r"models\.kpred.*(empty|not a kpred|damaged)"):
        Database.open(path)
    assert path.read_bytes() == content


def test_damaged_tokens_are_told(filled):
    with closing(sqlite3.connect(filled)) as connection:
        connection.execute("UPDATE descriptor SET tokens = substr(tokens, 9)")
        connection.commit()
    with Database.open(filled) as database, pytest.raises(DatabaseError, match="damaged"):
        database.search("chair", np.zeros((12, 128), np.float32))


@pytest.mark.parametrize("share", [0.01, 0.3, 0.6, 0.99])
def test_truncated_files(filled, share):
    content = filled.read_bytes()
    filled.write_bytes(content[: int(share * len(content))])
    with pytest.raises(DatabaseError, match="damaged or cut short"):
        Database.open(filled)


ONE_CHAIR = "model = (SELECT id FROM model WHERE model_id = 'chair-2')"


@pytest.mark.parametrize("name", ["points", "point_parts", "structure.axes", "structure.mirror"])
@pytest.mark.parametrize("damage", ["UPDATE array SET data = substr(data, 3)", "DELETE FROM array"])
def test_damaged_arrays_are_told(filled, name, damage):
    with closing(sqlite3.connect(filled)) as connection:
        connection.execute(f"{damage} WHERE name = '{name}' AND {ONE_CHAIR}")
        connection.commit()
    with Database.open(filled) as database:
        for read in (lambda: database.candidates("chair"), lambda: database.entry("chair-2")):
            with pytest.raises(DatabaseError, match=r"models\.kpred: model chair-2: .*damaged"):
                read()
        assert database.candidates("chair", ["chair-1"]).model_ids == ("chair-1",)


IMPOSSIBLE = {
    "structure.axes": np.full((3, 3, 3), 0.1),
    "structure.boxes": np.full((3, 2, 3), np.nan),
    "structure.contact_parts": np.full((4, 2), 3),
    "structure.contact_points": np.full((4, 3), 1e9),
    "structure.mirrored_parts": np.array([0, 1, -2]),
    "structure.affine_ranges": np.array([[0.0, 3.0, 0.0, 1.0]]),
    "structure.curved": np.zeros(0),
    "structure.mirror": np.array([np.inf]),
    "point_parts": np.full(64, 3),
    "point_normals": np.full((64, 3), 1.5),
    "structure.vertex_parts": np.full(20, 3),
    "structure.facets": np.full(30, 30),
}


@pytest.mark.parametrize("name", IMPOSSIBLE)
def test_numbers_that_cannot_be_are_refused_with_the_model_named(filled, name):
    columns = pack_array(IMPOSSIBLE[name], "<f4" if IMPOSSIBLE[name].dtype.kind == "f" else "<i2")
    with closing(sqlite3.connect(filled)) as connection:
        assignments = ", ".join(f"{column} = :{column}" for column in columns)
        connection.execute(f"UPDATE array SET {assignments} WHERE name = '{name}' AND {ONE_CHAIR}", columns)
        connection.commit()
    with Database.open(filled) as database:
        with pytest.raises(DatabaseError, match=f"model chair-2: .*{name.split('.')[-1]}.*damaged"):
            database.entry("chair-2")
        if name in ("structure.vertex_parts", "structure.facets"):
            assert len(database.candidates("chair").model_ids) == 6, "fitting does not read them"
        else:
            with pytest.raises(DatabaseError, match="model chair-2: "):
                database.candidates("chair")


def test_arrays_that_grow_beyond_their_shape_are_damaged() -> None:
    packed = zlib.compress(bytes(4_000_000))
    for shape in ("10,3", "1000001", "999999", "-1", "900000000000"):
        with pytest.raises(DamagedArray, match="are no <i4 array of shape"):
            unpack_array("<i4", shape, None, "shuffle-zlib", packed)
    with pytest.raises(ValueError, match="268435457 bytes"):  # However well it is compressed.
        inflate(packed, (1 << 28) + 1)
    assert not unpack_array("<i4", "1000000", None, "shuffle-zlib", packed).any()
