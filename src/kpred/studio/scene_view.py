"""What one tab shows in three dimensions: scan, result, keypoints, a part, the box of a crop; the scan's unit box."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from kpred.ops.typing import Float
from kpred.rendering.deviations import Deviations
from kpred.studio.shape import Shape
from kpred.studio.state import State

RESULT, PART = (176, 190, 206), (255, 160, 50)
FREE, PINNED, SELECTED = (70, 70, 80), (230, 126, 34), (33, 102, 172)
POINT_SIZE, BALL, HANDLE = 0.012, 0.028, 0.35

STRAYED = 1e-4
"""Distance of the handle from its keypoint above which it is put back, unit box."""

CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
EDGES = [(a, b) for a in range(8) for b in range(a + 1, 8) if int(np.abs(CORNERS[a] - CORNERS[b]).sum()) == 1]


class SceneView:
    """Nodes of one tab's scene.

    Args:
        client: viser's; selected: is given a keypoint that was clicked; moved: is given the place of the handle.
    """

    def __init__(self, client: Any, selected: Callable[[int], None], moved: Callable[[np.ndarray], None]) -> None:
        self._scene, self._selected, self._moved = client.scene, selected, moved
        self._mesh: Any = None
        self._faces: np.ndarray | None = None
        self._scan: Any = None
        self._part: Any = None
        self._balls: list[Any] = []
        self._handle: Any = None
        self._handle_of: tuple[int, str | None] | None = None
        self._box: CropBox | None = None
        self.opacity = 1.0
        self._scene.set_up_direction("+y")
        self._scene.add_grid("/floor", width=4.0, height=4.0, plane="xz", cell_size=0.25, position=(0.0, -1.02, 0.0))
        client.camera.position, client.camera.look_at = (1.9, 1.5, 3.1), (0.0, 0.0, 0.0)

    def show(self, state: State, deviations: Deviations, keypoint: int | None, axis: str | None, part: int) -> None:
        """Show a state; `keypoint` has the handle, which moves along `axis` alone, if there is one."""
        self._show_mesh(state)
        if self._scan is not None:
            self._scan.remove()
        self._scan = self._scene.add_point_cloud(
            "/scan", deviations.points.astype(np.float32), deviations.colors(), POINT_SIZE, "circle"
        )
        for ball in self._balls:
            ball.remove()
        self._balls = [self._ball(state, number, keypoint) for number in range(len(state.shape.keypoints))]
        self._show_part(state, part)
        self._show_handle(state, keypoint, axis)

    def follow(self, state: State, shape: Shape) -> None:
        """Show a shape under the hand: the mesh and the keypoints alone, quickly."""
        if self._mesh is None or self._faces is not state.fit.mesh.faces:
            self._show_mesh(state)
        self._mesh.vertices = shape.vertices.astype(np.float32)
        for ball, place in zip(self._balls, shape.keypoints, strict=True):
            ball.position = place
        if self._part is not None:
            self._part.remove()
            self._part = None

    def show_layers(self, scan: bool, result: bool, keypoints: bool) -> None:
        """Show or hide the layers."""
        self._scan.visible, self._mesh.visible = scan, result
        for ball in self._balls:
            ball.visible = keypoints
        if self._handle is not None:
            self._handle.visible = keypoints

    def set_opacity(self, opacity: float) -> None:
        """Make the result more or less transparent."""
        self.opacity = opacity
        if self._mesh is not None:
            self._mesh.opacity = opacity if opacity < 1.0 else None

    def show_box(self, state: State, visible: bool) -> CropBox | None:
        """Show the box of a crop around the scan, with handles at two corners, or remove it."""
        if self._box is not None:
            self._box.remove()
        self._box = CropBox(self._scene, state) if visible else None
        return self._box

    def _show_mesh(self, state: State) -> None:
        faces = state.fit.mesh.faces
        if self._faces is not faces:
            if self._mesh is not None:
                self._mesh.remove()
            self._mesh = self._scene.add_mesh_simple(
                "/result", state.shape.vertices.astype(np.float32), np.asarray(faces), color=RESULT, flat_shading=True,
                side="double", opacity=self.opacity if self.opacity < 1.0 else None,
            )  # fmt: skip
            self._faces = faces
        else:
            self._mesh.vertices = state.shape.vertices.astype(np.float32)

    def _ball(self, state: State, number: int, keypoint: int | None) -> Any:
        color = SELECTED if number == keypoint else PINNED if number in state.pins else FREE
        ball = self._scene.add_icosphere(
            f"/keypoints/{number}", radius=BALL, color=color, position=state.shape.keypoints[number]
        )
        ball.on_click(lambda _: self._selected(number))
        return ball

    def _show_part(self, state: State, part: int) -> None:
        if self._part is not None:
            self._part.remove()
            self._part = None
        if part < 0:
            return
        parts, faces = state.fit.placed.entry.structure.vertex_parts, np.asarray(state.fit.mesh.faces)
        mine = faces[(parts[faces] == part).all(axis=1)]
        if len(mine):
            vertices = state.shape.vertices
            middle = vertices[np.unique(mine)].mean(axis=0)
            self._part = self._scene.add_mesh_simple(
                "/part", ((vertices - middle) * 1.004 + middle).astype(np.float32), mine, color=PART, side="double",
                flat_shading=True,
            )  # fmt: skip

    def _show_handle(self, state: State, keypoint: int | None, axis: str | None) -> None:
        shown = None if keypoint is None else (keypoint, axis)
        if self._handle is not None and self._handle_of == shown and keypoint is not None:
            # It stays: the hand may hold it.
            if np.abs(np.array(self._handle.position) - state.shape.keypoints[keypoint]).max() > STRAYED:
                self._handle.position = state.shape.keypoints[keypoint]
            return
        if self._handle is not None:
            self._handle.remove()
            self._handle = None
        self._handle_of = shown
        if keypoint is None:
            return
        handle = self._scene.add_transform_controls(
            "/handle", scale=HANDLE, disable_rotations=True, disable_sliders=axis is not None, depth_test=False,
            active_axes=tuple(axis in (None, one) for one in ("x", "y", "z")), position=state.shape.keypoints[keypoint],
        )  # fmt: skip
        handle.on_update(lambda event: self._moved(np.array(handle.position)))
        self._handle = handle


class CropBox:
    """A box around the scan, along the object's axes, whose two corners are dragged."""

    def __init__(self, scene: Any, state: State) -> None:
        self._scene = scene
        points = state.fit.frame.to_unit(state.points)
        margin = 0.02 * np.ptp(points, axis=0).max()
        ends = points.min(axis=0) - margin, points.max(axis=0) + margin
        self._handles = [
            scene.add_transform_controls(f"/crop/{name}", scale=HANDLE, disable_rotations=True, position=end)
            for name, end in zip(("low", "high"), ends, strict=True)
        ]
        for handle in self._handles:
            handle.on_update(lambda _: self._draw())
        self._lines: Any = None
        self._draw()

    def corners(self) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]:
        """Return the lowest and highest corner, the scan's unit box."""
        places = np.stack([np.array(handle.position, dtype=np.float64) for handle in self._handles])
        return places.min(axis=0), places.max(axis=0)

    def remove(self) -> None:
        """Remove the box from the scene."""
        for node in (*self._handles, self._lines):
            node.remove()

    def _draw(self) -> None:
        low, high = self.corners()
        places = low + CORNERS * (high - low)
        segments = np.array([[places[a], places[b]] for a, b in EDGES])
        self._lines = self._scene.add_line_segments("/crop/edges", segments, colors=PINNED, line_width=2.0)
