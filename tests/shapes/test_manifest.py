"""Meshes named by a Parquet manifest: broken rows are told and left out."""

import numpy as np
import pytest

from kpred.errors import ManifestError
from kpred.shapes.source import open_shapes

pyarrow = pytest.importorskip("pyarrow", reason="no Parquet: pip install 'kpred[parquet]'")


def test_meshes_of_a_manifest(tmp_path):
    from pyarrow import parquet

    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    (tmp_path / "broken.obj").write_text("v 0 0\n")
    table = {
        "path": ["a.obj", str(tmp_path / "a.obj"), "broken.obj", None, "none.obj", "a.obj", "a.obj"],
        "id": ["one", "two", "three", "four", "five", "six", "seven"],
        "category": ["chair", "chair", "chair", "chair", "chair", "table", None],
        "split": ["source", "val", None, None, None, None, None],
    }
    manifest = tmp_path / "meshes.parquet"
    parquet.write_table(pyarrow.table(table), manifest)
    told = []
    shapes = list(open_shapes(manifest, report=told.append))
    assert [(s.model_id, s.category, s.split) for s in shapes] == [
        ("one", "chair", "source"),
        ("two", "chair", "val"),
        ("six", "table", "source"),
    ]
    np.testing.assert_array_equal(shapes[0].mesh.faces, [[0, 1, 2]])
    assert len(told) == 4
    assert "broken.obj" in told[0]
    assert "row 3" in told[1]
    assert "none.obj" in told[2]
    assert "row 6" in told[3]
    assert [s.model_id for s in open_shapes(manifest, "table", report=told.append)] == ["six", "seven"]
    assert [s.model_id for s in open_shapes(manifest, "chair", "val", report=told.append)] == ["two"]
    manifest.write_bytes(b"PAR1 nothing PAR1")
    with pytest.raises(ManifestError, match="no whole Parquet"):
        list(open_shapes(manifest))
