"""The picture of a fit: what it shows, and that it comes out, or is left out with one warning."""

import subprocess
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import trimesh

from kpred.errors import OutputError
from kpred.ops.frames import Frame, unit_box_frame
from kpred.rendering import draw
from kpred.rendering.draw import PictureWarning
from kpred.rendering.picture import PICTURE_SIZE, fit_view, save_picture


@dataclass(frozen=True)
class ToyFit:
    frame: Frame
    mesh: trimesh.Trimesh
    retrieved_mesh: trimesh.Trimesh


@pytest.fixture
def toy() -> tuple[ToyFit, np.ndarray]:
    """A z-up scan of a box far from the origin, and a fit of it."""
    rng = np.random.default_rng(0)
    box = trimesh.creation.box((1.0, 2.0, 3.0))
    box.apply_translation((10, 20, 30))
    smaller = box.copy()
    smaller.vertices = (smaller.vertices - (10, 20, 30)) * 0.5 + (10, 20, 30)
    scan = trimesh.sample.sample_surface(box, 20_000, seed=rng)[0]
    scan = np.concatenate([scan, box.vertices])
    to_y_up = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    return ToyFit(unit_box_frame(scan, to_y_up), box, smaller), np.asarray(scan)


def test_the_view_lies_in_the_unit_box_with_y_up(toy: tuple[ToyFit, np.ndarray]) -> None:
    view = fit_view(*toy)
    (scan,), (retrieved,), (result, over) = (panel.layers for panel in view.panels)
    assert len(scan.vertices) <= 6000
    np.testing.assert_array_equal(over.vertices, scan.vertices)
    np.testing.assert_allclose(np.ptp(result.vertices, axis=0), [2 / 3, 2, 4 / 3], atol=1e-5)
    np.testing.assert_allclose(result.vertices.max(axis=0), [1 / 3, 1, 2 / 3], atol=1e-5)
    np.testing.assert_allclose(np.ptp(retrieved.vertices, axis=0), [1 / 3, 1, 2 / 3], atol=1e-5)
    assert (np.linalg.norm(result.vertices - view.center, axis=1) <= view.radius * (1 + 1e-6)).all()


def test_three_different_panels_are_drawn(toy: tuple[ToyFit, np.ndarray], tmp_path: Path) -> None:
    file = tmp_path / "fit.png"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PictureWarning)  # a machine without a graphics library draws with matplotlib
        assert save_picture(*toy, file)
    _check_panels(file)
    assert [path.name for path in tmp_path.iterdir()] == ["fit.png"]


def test_without_graphics_matplotlib_draws(
    toy: tuple[ToyFit, np.ndarray], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def crash(*arguments: object, **options: object) -> subprocess.CompletedProcess[bytes]:
        return subprocess.CompletedProcess([], returncode=-11)

    monkeypatch.setattr(draw.subprocess, "run", crash)
    file = tmp_path / "fit.png"
    with pytest.warns(PictureWarning, match="apt-get install libegl1"):
        assert save_picture(*toy, file)
    _check_panels(file)


def test_without_any_drawing_package_one_warning_says_so(
    toy: tuple[ToyFit, np.ndarray], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(draw, "find_spec", lambda name: None)
    with pytest.warns(PictureWarning, match=r"pip install 'kpred\[pictures\]'") as caught:
        assert not save_picture(*toy, tmp_path / "fit.png")
    assert len(caught) == 1
    assert not list(tmp_path.iterdir())


def test_only_png_files_are_pictures(toy: tuple[ToyFit, np.ndarray], tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="jpg"):
        save_picture(*toy, tmp_path / "fit.jpg")


def _check_panels(file: Path) -> None:
    from matplotlib.image import imread

    image = imread(file)[..., :3]
    assert image.shape[:2] == (PICTURE_SIZE[1], PICTURE_SIZE[0])
    panels = np.split(image, 3, axis=1)
    drawn = [float((panel < 0.97).any(axis=2).mean()) for panel in panels]
    assert min(drawn) > 0.01  # nothing is blank
    assert drawn[2] > 1.5 * drawn[1]  # the result is twice the size of the retrieved model
    reddish = (panels[2][..., 0] > panels[2][..., 2] + 0.2).sum()
    assert reddish > 50  # the scan's points lie over the result
