"""What a picture shows: panels of points and meshes, all seen by one camera."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field

import numpy as np

from kpred.ops.typing import Float, Int, UInt8
from kpred.shapes.camera import Camera

VIEW_DIRECTION = (0.62, 0.48, 1.0)
"""From an object to the eye, in canonical axes (y up, front +z): three-quarter from the front, from above."""

Color = tuple[int, int, int]
"""Red, green, blue, 0 to 255."""


@dataclass(frozen=True)
class Style:
    """How a layer is drawn.

    Attributes:
        point_size: of points, pixels; balls: whether points are shaded balls.
        opacity: 0 to 1; lit: whether lights shade it; smooth: whether normals are interpolated between faces.
        ambient, diffuse: of lit surfaces.
        one_sided: whether faces that are seen from behind are left out.
        lifted: whether it is moved a little toward the eye, off surfaces that it lies in.
    """

    point_size: float = 4.0
    balls: bool = False
    opacity: float = 1.0
    lit: bool = True
    smooth: bool = False
    ambient: float = 0.2
    diffuse: float = 0.85
    one_sided: bool = False
    lifted: bool = False


@dataclass(frozen=True, eq=False)
class Layer:
    """Points, or a mesh.

    Attributes:
        vertices: (N, 3) float32, y up; faces: (F, 3) int32, none for points.
        colors: uint8, (1, 3) of all, (N, 3) of points or vertices, (F, 3) of faces; (0, 3): points by their height.
    """

    vertices: Float[np.ndarray, "vertices 3"]
    faces: Int[np.ndarray, "faces 3"]
    colors: UInt8[np.ndarray, "colors 3"]
    style: Style = field(default_factory=Style)


@dataclass(frozen=True, eq=False)
class Panel:
    """One part of a picture.

    Attributes:
        title: above it; layers: drawn in this order; labels, anchors: texts, and where they stand, (K, 3).
    """

    title: str
    layers: tuple[Layer, ...]
    labels: tuple[str, ...] = ()
    anchors: Float[np.ndarray, "labels 3"] = field(default_factory=lambda: np.zeros((0, 3), np.float32))


@dataclass(frozen=True, eq=False)
class View:
    """A picture: panels side by side, seen by one camera.

    Attributes:
        panels: of equal width; size: of the picture, pixels.
        center, radius: of the ball that is seen; direction: from it to the eye.
        angle: of the camera, degrees; closeness: 1 shows all of the ball, more comes nearer.
        lights: strength of key, fill and head light; font_size: of titles.
    """

    panels: tuple[Panel, ...]
    size: tuple[int, int]
    center: Float[np.ndarray, "3"]
    radius: float
    direction: tuple[float, float, float] = VIEW_DIRECTION
    angle: float = 26.0
    closeness: float = 1.0
    lights: tuple[float, float, float] = (0.36, 0.14, 0.12)
    font_size: int = 11

    def to_arrays(self) -> dict[str, np.ndarray]:
        """Return all as arrays by name, for `draw_pyvista`; `view` is JSON of what is no array."""
        arrays: dict[str, np.ndarray] = {}
        facts = {key: value for key, value in self.__dict__.items() if key not in ("panels", "center")}
        panels = []
        for number, panel in enumerate(self.panels):
            arrays[f"{number}.anchors"] = panel.anchors
            styles = []
            for place, layer in enumerate(panel.layers):
                for name in ("vertices", "faces", "colors"):
                    arrays[f"{number}.{place}.{name}"] = getattr(layer, name)
                styles.append(asdict(layer.style))
            panels.append({"title": panel.title, "labels": panel.labels, "layers": styles})
        return arrays | {"center": self.center, "view": np.array(json.dumps({**facts, "panels": panels}))}


def eye_axes(direction: Sequence[float]) -> Float[np.ndarray, "3 3"]:
    """Compute unit vectors to the right, up, and toward an eye in this direction, as rows; y is up."""
    toward = np.asarray(direction, dtype=np.float64) / np.linalg.norm(direction)
    right = np.cross([0.0, 1.0, 0.0], toward)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(toward, right), toward])


def square_camera(center: np.ndarray, distance: float, focal: float, pixels: int) -> Camera:
    """Make a camera that looks along `VIEW_DIRECTION` at a point; `focal`: twice the focal length / picture's side."""
    right, up, toward = eye_axes(VIEW_DIRECTION)
    pose = np.eye(4)
    pose[:3, :3] = np.stack([right, -up, -toward], axis=1)
    pose[:3, 3] = center + toward * distance
    length, middle = focal * pixels / 2, (pixels - 1) / 2
    return Camera(np.array([[length, 0, middle], [0, length, middle], [0, 0, 1]]), pixels, pixels, pose)
