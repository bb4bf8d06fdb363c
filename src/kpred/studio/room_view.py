"""What a tab shows of a room in three dimensions: the scan, and each object's result with its name; y up."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from kpred.fitting.fit_room import LevelRoom
from kpred.fitting.object_fit import ObjectFit
from kpred.fitting.scene_nodes import OBJECT_COLORS
from kpred.ops.rotations import upright_rotation
from kpred.ops.typing import Float

MAX_POINTS = 60_000
REACH = 3.0
"""Half of the room's longest side, as it is shown."""

CEILING = 0.85
"""Points above this fraction of the room's height are not shown: they would hide the rest from above."""

GREY, POINT_SIZE = (170, 176, 184), 0.014


class RoomView:
    """Nodes of one tab's scene.

    Args:
        client: viser's; room, items: the room and what became of its objects, level frame.
        chosen: is given the name of an object that was clicked.
    """

    def __init__(
        self, client: Any, room: LevelRoom, items: tuple[ObjectFit, ...], chosen: Callable[[str], None]
    ) -> None:
        points = room.scan.points @ room.leveling.T
        finite = np.isfinite(points).all(axis=1)
        self._turn = upright_rotation(room.up)
        upright = points[finite] @ self._turn.T
        low, high = np.quantile(upright, [0.005, 0.995], axis=0)
        self._middle = np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
        self._scale = 2.0 * REACH / max(float((high - low).max()), 1e-9)
        scene = client.scene
        scene.set_up_direction("+y")
        client.camera.position, client.camera.look_at = (3.2, 6.0, 6.4), (0.0, 0.3, 0.0)
        shown = upright[:, 1] < low[1] + CEILING * (high[1] - low[1])
        colors = None if room.scan.colors is None else room.scan.colors[finite]
        self._add_scan(scene, upright[shown], None if colors is None else colors[shown])
        for number, item in enumerate(items):
            if item.fit is not None:
                self._add_object(scene, item, OBJECT_COLORS[number % len(OBJECT_COLORS)], chosen)

    def place(self, points: Float[np.ndarray, "points 3"]) -> Float[np.ndarray, "points 3"]:
        """Take points of the level frame to where they are shown."""
        return self._shown(points @ self._turn.T)

    def _shown(self, upright: np.ndarray) -> np.ndarray:
        shown: np.ndarray = (upright - self._middle) * self._scale
        return shown

    def _add_scan(self, scene: Any, upright: np.ndarray, colors: np.ndarray | None) -> None:
        step = max(1, -(-len(upright) // MAX_POINTS))
        few = self._shown(upright[::step]).astype(np.float32)
        painted = np.tile(np.array(GREY, np.uint8), (len(few), 1)) if colors is None else colors[::step]
        scene.add_point_cloud("/scan", few, painted, POINT_SIZE, "circle")

    def _add_object(
        self, scene: Any, item: ObjectFit, color: tuple[int, int, int], chosen: Callable[[str], None]
    ) -> None:
        assert item.fit is not None
        name = item.object.name
        vertices = self.place(np.asarray(item.fit.mesh.vertices, dtype=np.float64))
        mesh = scene.add_mesh_simple(
            f"/objects/{name}", vertices.astype(np.float32), np.asarray(item.fit.mesh.faces), color=color,
            side="double", flat_shading=True,
        )  # fmt: skip
        mesh.on_click(lambda _: chosen(name))
        low, high = vertices.min(axis=0), vertices.max(axis=0)
        top = np.array([(low[0] + high[0]) / 2, high[1] + 0.1, (low[2] + high[2]) / 2])
        scene.add_label(f"/names/{name}", name, position=top)
