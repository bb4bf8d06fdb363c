"""The result over the photograph: in the right place, half transparent, nowhere else."""

import os
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from kpred.errors import ConfigError, OutputError, ScanError
from kpred.rendering.draw import PictureWarning
from kpred.rendering.overlay import draw_overlay, read_photograph, save_overlay
from kpred.shapes.camera import Camera
from kpred.shapes.render import render_faces

CAMERA = Camera(np.array([[150.0, 0, 79.5], [0, 150, 59.5], [0, 0, 1]]), 160, 120)


def box(center: list[float], size: float = 0.5) -> trimesh.Trimesh:
    mesh = trimesh.creation.box((size, size, size))
    mesh.apply_translation(center)
    return mesh


@pytest.fixture
def photograph(rng: np.random.Generator) -> np.ndarray:
    return rng.integers(60, 200, size=(120, 160, 3)).astype(np.uint8)


def test_only_pixels_that_show_the_result_change(photograph: np.ndarray) -> None:
    mesh = box([0.2, -0.1, 2.0])
    drawn = draw_overlay(photograph, mesh.vertices, mesh.faces, CAMERA)
    changed = (drawn != photograph).any(axis=2)
    seen = render_faces(mesh.vertices, mesh.faces, CAMERA)[1] >= 0
    assert changed[seen].mean() > 0.99
    rows, columns = np.nonzero(seen)
    outside = np.ones_like(seen)
    outside[rows.min() - 2 : rows.max() + 3, columns.min() - 2 : columns.max() + 3] = False
    assert not changed[outside].any()
    middle = np.array([columns.mean(), rows.mean()])
    expected = CAMERA.project(np.array([[0.2, -0.1, 1.75]]))[0][0]
    assert np.linalg.norm(middle - expected) < 3


def test_faces_let_the_photograph_through_and_outlines_do_not() -> None:
    mesh = box([0, 0, 2.0])
    dark, light = (np.full((120, 160, 3), level, dtype=np.uint8) for level in (20, 220))
    one, other = (draw_overlay(picture, mesh.vertices, mesh.faces, CAMERA, opacity=0.5) for picture in (dark, light))
    through = (other.astype(float) - one)[..., 0] / 200
    assert through[60, 80] == pytest.approx(0.5, abs=0.02)
    assert through[5, 5] == 1
    left = np.flatnonzero(through[60] < 0.99)[0]
    assert through[60, left : left + 3].min() < 0.3


def test_the_nearer_of_two_boxes_is_drawn_and_the_hidden_one_is_not(photograph: np.ndarray) -> None:
    front, back = box([0, 0, 1.5], 0.6), box([0, 0, 3.0], 0.3)
    both = trimesh.util.concatenate([back, front])
    np.testing.assert_array_equal(
        draw_overlay(photograph, both.vertices, both.faces, CAMERA),
        draw_overlay(photograph, front.vertices, front.faces, CAMERA),
    )


def test_a_larger_photograph_of_the_same_view_shows_the_same(photograph: np.ndarray) -> None:
    mesh, grey = box([0.2, -0.1, 2.0]), np.full((120, 160, 3), 128, dtype=np.uint8)
    small = draw_overlay(grey, mesh.vertices, mesh.faces, CAMERA) != 128
    large = draw_overlay(grey.repeat(2, 0).repeat(2, 1), mesh.vertices, mesh.faces, CAMERA) != 128
    assert (small.any(2) != large.any(2)[::2, ::2]).mean() < 0.02
    with pytest.raises(ConfigError, match="proportions"):
        draw_overlay(grey[:, :100], mesh.vertices, mesh.faces, CAMERA)


def test_the_file_holds_what_is_drawn(photograph: np.ndarray, tmp_path: Path) -> None:
    mesh = box([0, 0, 2.0])
    Image.fromarray(photograph).save(tmp_path / "photo.png")
    save_overlay(mesh.vertices, mesh.faces, CAMERA, tmp_path / "photo.png", tmp_path / "over.png")
    with Image.open(tmp_path / "over.png") as picture:
        np.testing.assert_array_equal(picture, draw_overlay(photograph, mesh.vertices, mesh.faces, CAMERA))
    assert sorted(file.name for file in tmp_path.iterdir()) == ["over.png", "photo.png"]


def test_what_cannot_be_drawn_is_said(photograph: np.ndarray, tmp_path: Path) -> None:
    mesh, away = box([0, 0, 2.0]), box([0, 0, -2.0])
    Image.fromarray(photograph).save(tmp_path / "photo.png")
    (tmp_path / "noise.jpg").write_bytes(b"nothing")
    with pytest.warns(PictureWarning, match="outside of the picture"):
        save_overlay(away.vertices, away.faces, CAMERA, tmp_path / "photo.png", tmp_path / "over.png")
    for name, word in (("none.png", "no such file"), ("noise.jpg", "not a picture")):
        with pytest.raises(ScanError, match=word) as caught:
            save_overlay(mesh.vertices, mesh.faces, CAMERA, tmp_path / name, tmp_path / "over.png")
        assert name in str(caught.value)
    with pytest.raises(OutputError, match=r"\.png"):
        save_overlay(mesh.vertices, mesh.faces, CAMERA, tmp_path / "photo.png", tmp_path / "over.jpg")


def test_a_pipe_and_a_folder_are_no_photographs(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.png")
    for place, word in ((tmp_path / "pipe.png", "pipe"), (tmp_path, "folder")):
        with pytest.raises(ScanError, match=word):
            read_photograph(place)


def test_too_many_pixels_are_refused_before_they_are_decoded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    Image.new("1", (9000, 8000)).save(tmp_path / "large.png")
    assert (tmp_path / "large.png").stat().st_size < 20_000
    monkeypatch.setattr(Image.Image, "convert", lambda *_: pytest.fail("decoded"))
    with pytest.raises(ScanError, match="9000 x 8000 pixels"):
        read_photograph(tmp_path / "large.png")
