"""A process that stays draws what one of its own does, and is replaced when it fails."""

from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from kpred.rendering.draw import draw_view
from kpred.rendering.drawing_process import DrawingProcess
from kpred.rendering.view import Layer, Panel, View

pytestmark = pytest.mark.skipif(find_spec("pyvista") is None, reason="pyvista is not installed")


def test_it_draws_the_same_and_survives_a_broken_view(tmp_path: Path) -> None:
    corners = np.eye(3, dtype=np.float32)
    layer = Layer(corners, np.array([[0, 1, 2]], np.int32), np.array([[200, 0, 0]], np.uint8))
    view = View((Panel("a", (layer,)),), (120, 90), corners.mean(axis=0).astype(np.float64), 1.0)
    np.savez(tmp_path / "view.npz", **view.to_arrays())
    (tmp_path / "broken.npz").write_bytes(b"none")
    process = DrawingProcess()
    try:
        if not process.draw(tmp_path / "view.npz", tmp_path / "a b.png", 60.0):
            pytest.skip("no graphics library that works")
        draw_view(view, tmp_path / "c.png")
        assert (tmp_path / "a b.png").read_bytes() == (tmp_path / "c.png").read_bytes()
        assert not process.draw(tmp_path / "broken.npz", tmp_path / "d.png", 60.0)
        assert process.draw(tmp_path / "view.npz", tmp_path / "e.png", 60.0)
        assert (tmp_path / "e.png").read_bytes() == (tmp_path / "c.png").read_bytes()
    finally:
        process.stop()
