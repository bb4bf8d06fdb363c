"""`kpred database update`: what an old file is refused with, the numbers, and a second run."""

import shutil
import sqlite3
from contextlib import closing


def test_an_old_file_is_updated_once(files, tmp_path, run_json, refusal):
    path = tmp_path / "tables.kpred"
    shutil.copy(files / "tables.kpred", path)
    with closing(sqlite3.connect(path)) as connection:
        connection.execute("DELETE FROM array WHERE name LIKE 'structure.%' OR name IN ('point_parts','point_normals')")
        connection.execute("PRAGMA user_version = 2")
        connection.commit()
    assert f"run 'kpred database update {path}'" in refusal("database", "info", path)
    assert run_json("database", "update", path) == {"path": str(path), "updated": 8}
    assert run_json("database", "update", path) == {"path": str(path), "updated": 0}
    known, updated = (run_json("database", "info", file)["categories"] for file in (files / "tables.kpred", path))
    assert updated == known
    assert run_json("database", "copy", path, tmp_path / "copy.kpred")["verified"] == 8
    assert "does not exist" in refusal("database", "update", tmp_path / "none.kpred")
