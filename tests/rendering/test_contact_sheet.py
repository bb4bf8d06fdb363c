"""Contact sheets: every tile in its place, in its colour, with labels that stay inside."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from kpred.errors import OutputError
from kpred.rendering.contact_sheet import PANEL, Tile, draw_contact_sheet, draw_tile, save_contact_sheet


@pytest.fixture
def tile() -> Tile:
    box = trimesh.creation.box((1, 2, 0.5))
    return Tile(("a box", "found: a box"), "right", trimesh.sample.sample_surface(box, 900, seed=0)[0] * 7, box)


def ink(panel: np.ndarray) -> np.ndarray:
    return np.asarray((panel < 250).any(axis=2))


def test_panels_show_scan_result_and_both(tile: Tile) -> None:
    box = trimesh.creation.box((7, 14, 3.5))
    scan, result, both = np.split(draw_tile(Tile((), "open", tile.scan, box)), 3, axis=1)
    assert scan.shape == (PANEL, PANEL, 3)
    # The same thing seen by the same camera: points lie where the mesh is drawn.
    assert ink(result).mean() > 0.1
    assert (ink(scan) & ~ink(result)).sum() < 0.05 * ink(scan).sum()
    red = (both[..., 0] > 150) & (both[..., 1] < 100)
    assert red.sum() > 300
    assert not ((result[..., 0] > 150) & (result[..., 1] < 100)).any()


def test_a_scan_without_result_leaves_its_panels_white(tile: Tile) -> None:
    scan, result, both = np.split(draw_tile(Tile((), "wrong", tile.scan)), 3, axis=1)
    assert ink(scan).any()
    assert not ink(result).any()
    assert not ink(both).any()


def test_higher_is_drawn_higher() -> None:
    low = np.random.default_rng(0).random((500, 3)) * [1, 0.1, 1]
    post = np.linspace([0.5, 0, 0.5], [0.5, 3, 0.5], 200)
    rows = np.flatnonzero(ink(draw_tile(Tile((), "open", np.concatenate([low, post])))[:, :PANEL]).any(axis=1))
    widths = ink(draw_tile(Tile((), "open", np.concatenate([low, post])))[:, :PANEL]).sum(axis=1)[rows]
    assert widths[:10].max() < 6 < widths[-20:].max()


def test_all_tiles_are_on_the_sheet_and_labels_stay_inside(tile: Tile) -> None:
    long = Tile(("word " * 200,), "wrong", tile.scan, tile.result)
    sheet = np.asarray(draw_contact_sheet([tile, long, tile, tile, tile]))
    height, width = sheet.shape[0] // 2, sheet.shape[1] // 3
    for number in range(6):
        part = sheet[number // 3 * height :, number % 3 * width :][:height, :width]
        assert ink(part).any() == (number < 5)
        frame = part[height // 2, :8].astype(int)
        red = (frame[:, 0] > frame[:, 1] + 80).any()
        assert red == (number == 1)
        # Nothing is written across the border between tiles.
        assert not ink(part)[:, :3].any()


@pytest.mark.parametrize("points", [np.zeros((1, 3)), np.full((5, 3), 3.0)])
def test_a_scan_without_size_is_no_trouble(points: np.ndarray) -> None:
    assert draw_tile(Tile((), "wrong", points)).shape == (PANEL, 3 * PANEL, 3)


def test_only_png_and_all_or_nothing(tile: Tile, tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"\.png"):
        save_contact_sheet([tile], tmp_path / "sheet.jpg")
    with pytest.raises(OutputError, match="make it first"):
        save_contact_sheet([tile], tmp_path / "none" / "sheet.png")
    assert not list(tmp_path.iterdir())
    save_contact_sheet([tile], tmp_path / "sheet.png")
    assert Image.open(tmp_path / "sheet.png").size[0] > 3 * PANEL
