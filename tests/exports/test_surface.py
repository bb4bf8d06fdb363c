"""OBJ, PLY, STL and OFF hold the surface in the scan's own frame and unit."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from kpred.errors import OutputError
from kpred.exports.formats import save_export
from kpred.exports.furniture import Export
from kpred.shapes import read_mesh
from kpred.shapes.mesh_io import read_geometry


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


FAR = np.array([694_386_212.0, 5_155_487_512.0, 381_036.0])
"""A place in UTM coordinates, millimetres; float32 has steps of half a metre there."""


@pytest.mark.parametrize("extension", [".obj", ".ply", ".off"])
def test_far_from_the_origin_no_vertex_moves(chair: Export, tmp_path: Path, extension: str) -> None:
    furniture = replace(chair.objects[0], vertices=chair.objects[0].vertices + FAR)
    file, *_ = save_export(replace(chair, objects=(furniture,)), tmp_path / f"chair{extension}")
    # A vertex may be written several times, once for each of its normals.
    offsets = read_geometry(file).vertices[:, None] - furniture.vertices[None]
    assert np.linalg.norm(offsets, axis=2).min(axis=1).max() < 0.01
    assert np.linalg.norm(offsets, axis=2).min(axis=0).max() < 0.01


def test_far_from_the_origin_stl_is_refused(chair: Export, tmp_path: Path) -> None:
    furniture = replace(chair.objects[0], vertices=chair.objects[0].vertices + FAR)
    with pytest.raises(OutputError, match=r"too coarse; use \.ply, \.obj or \.glb"):
        save_export(replace(chair, objects=(furniture,)), tmp_path / "chair.stl")
