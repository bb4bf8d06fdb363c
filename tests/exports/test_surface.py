"""OBJ, PLY, STL and OFF hold the surface in the scan's own frame and unit."""

from pathlib import Path

import numpy as np
import pytest

from kpred.errors import OutputError
from kpred.exports import Export, save_export
from kpred.shapes import read_mesh


@pytest.mark.parametrize("extension", [".obj", ".ply", ".stl", ".off"])
def test_the_scans_own_frame_and_unit_are_kept(chair: Export, tmp_path: Path, extension: str) -> None:
    file, *_ = save_export(chair, tmp_path / f"chair{extension}")
    wanted = chair.objects[0].vertices
    np.testing.assert_allclose(read_mesh(file).bounds, [wanted.min(axis=0), wanted.max(axis=0)], atol=0.01)


@pytest.mark.parametrize("extension", [".obj", ".ply", ".stl", ".off"])
def test_one_surface_is_no_room(room: Export, tmp_path: Path, extension: str) -> None:
    with pytest.raises(OutputError, match=r"holds one object; use \.glb"):
        save_export(room, tmp_path / f"room{extension}")
    assert not list(tmp_path.iterdir())
