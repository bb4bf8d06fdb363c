"""A depth sensor: noise that grows with the square of the depth, lost edges, grazing and glossy surfaces, range."""

from __future__ import annotations

from dataclasses import dataclass
from typing import no_type_check

import numba
import numpy as np


@dataclass(frozen=True)
class Sensor:
    """Errors of a depth sensor.

    Attributes:
        near, far: range, metres.
        noise: standard deviation at `near` and below 0.4 m, metres; growth: added per (depth - 0.4 m) squared.
        edge: depth step between neighbouring pixels, as a fraction of the depth, at which pixels are lost or fly.
        lost_edges: fraction of edge pixels that are lost; flying: fraction that lie between the two surfaces.
        grazing: cosine of the angle of incidence below which pixels are lost more and more.
        dropout: fraction of pixels lost anywhere.
    """

    near: float = 0.4
    far: float = 4.2
    noise: float = 0.0012
    growth: float = 0.0019
    edge: float = 0.035
    lost_edges: float = 0.6
    flying: float = 0.12
    grazing: float = 0.2
    dropout: float = 0.02

    def spread(self, depth: np.ndarray) -> np.ndarray:
        """Return the standard deviation of the noise at depths (any shape), metres."""
        return np.asarray(self.noise + self.growth * np.maximum(depth - 0.4, 0.0) ** 2)


def measured_depth(
    depth: np.ndarray,
    face: np.ndarray,
    normals: np.ndarray,
    loss: np.ndarray,
    pose: np.ndarray,
    focal: float,
    sensor: Sensor,
    rng: np.random.Generator,
) -> tuple[np.ndarray, np.ndarray]:
    """Measure a rendered depth image.

    Args:
        depth, face: (height, width), as of `render_frame`; normals: (F, 3) float32 unit normals of the faces, world.
        loss: (F,) fraction of readings that each face swallows; pose: (4, 4) camera to world.

    Returns:
        (height, width) float32 depth, 0 where nothing is measured; (height, width) bool: pixels that fly between two
        surfaces and belong to neither.
    """
    height, width = depth.shape
    # Neighbouring pixels share a part of their error, as block matching makes them.
    white = rng.standard_normal((2, (height + 3) // 2, (width + 3) // 2), dtype=np.float32)
    fine = rng.standard_normal((height, width), dtype=np.float32)
    chance = rng.random((2, height, width), dtype=np.float32)
    values = np.array(
        [
            *(sensor.near, sensor.far, sensor.noise, sensor.growth, sensor.edge),
            *(sensor.lost_edges, sensor.flying, sensor.grazing, sensor.dropout),
        ]
    )
    measured, flying = _measure(depth, face, normals, loss, pose, focal, values, white[0], fine, chance)
    return measured, flying


@numba.njit(cache=True)
@no_type_check
def _measure(depth, face, normals, loss, pose, focal, values, coarse, fine, chance):
    height, width = depth.shape
    near, far, noise, growth, edge, lost_edges, flying, grazing, dropout = values
    found = np.zeros((height, width), np.float32)
    between = np.zeros((height, width), np.bool_)
    for i in range(height):
        for j in range(width):
            z = depth[i, j]
            if z < near or z > far or face[i, j] < 0:
                continue
            if chance[0, i, j] < dropout + (1 - dropout) * loss[face[i, j]]:
                continue
            x = (j + 0.5 - width / 2) / focal
            y = (i + 0.5 - height / 2) / focal
            length = np.sqrt(x * x + y * y + 1.0)
            cosine = 0.0
            for k in range(3):
                ray = (pose[k, 0] * x + pose[k, 1] * y + pose[k, 2]) / length
                cosine += ray * normals[face[i, j], k]
            cosine = abs(cosine)
            if cosine < grazing and chance[1, i, j] > cosine / grazing:
                continue
            farthest = z
            is_edge = False
            for di, dj in ((0, 1), (1, 0), (0, -1), (-1, 0)):
                a, b = i + di, j + dj
                if a < 0 or b < 0 or a >= height or b >= width:
                    continue
                # A slanted plane also has steps; only jumps to another face are edges.
                step = depth[a, b] - z
                if depth[a, b] == 0 or (face[a, b] != face[i, j] and abs(step) > edge * z):
                    is_edge = True
                    farthest = max(farthest, depth[a, b])
            if is_edge:
                if chance[1, i, j] < lost_edges:
                    continue
                if chance[1, i, j] < lost_edges + flying and farthest > z:
                    z += (farthest - z) * (chance[0, i, j] * 0.8 + 0.1)
                    between[i, j] = True
            error = 0.75 * coarse[i // 2, j // 2] + 0.66 * fine[i, j]
            reach = max(z - 0.4, 0.0)
            found[i, j] = z + error * (noise + growth * reach * reach)
    return found, between
