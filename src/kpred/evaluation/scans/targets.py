"""Virtual scans: what one depth camera sees of a shape that stands somewhere, turned and in some size, y up.

Everything is drawn from seed and model id alone:
    camera      all round (azimuth), 0 to 45 degrees above the middle of the box, 1.5 to 4 longest sides away
    noise       along the viewing ray, standard deviation 0 to 1 % of half the longest side (`ops.depth_scan`'s measure)
    outliers    0 to 2 % of the points lie anywhere in 1.3 times the box instead
    place       yaw 0 to 360 degrees, longest side 0.3 to 2.5 units, middle of the box within 5 units of the origin
"""

from __future__ import annotations

import math
import zlib
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from kpred.database.encode import POINTS, prepare_mesh
from kpred.evaluation.metrics.symmetry import Symmetry, vertical_symmetry
from kpred.ops import Frame, depth_scan, sample_surface
from kpred.ops.rotations import yaw_rotation
from kpred.ops.typing import Float
from kpred.shapes.mesh import Mesh

ELEVATION = (0.0, 45.0)
DISTANCE = (1.5, 4.0)
NOISE = 0.01
OUTLIERS = 0.02
OUTLIER_BOX = 1.3
LONGEST_SIDE = (0.3, 2.5)
OFFSET = 5.0

_SURFACE_POINTS = 8192
_REACH = 1.4
"""Where the known frame ends: nothing of a target may lie farther out in the unit box of its whole object."""


@dataclass(frozen=True, eq=False)
class ScanTarget:
    """One virtual scan and the truth behind it.

    Attributes:
        model_id: of the shape.
        scan: (N, 3) what a fit is given, in the scan's own frame and unit, y up; N <= 2048.
        known: (N, 3) the same points in the unit box of the whole object, canonical axes.
        visible: (V, 3) what the camera saw, without noise and outliers; unit box.
        whole: (2048, 3) the whole surface, unit box.
        low, high: (3,) corners of the object's box, unit box; its longest side is 2.
        frame: takes the scan's own frame into the unit box.
        symmetry: turns about the vertical that leave the shape as it is.
    """

    model_id: str
    scan: Float[np.ndarray, "points 3"]
    known: Float[np.ndarray, "points 3"]
    visible: Float[np.ndarray, "visible 3"]
    whole: Float[np.ndarray, "whole 3"]
    low: Float[np.ndarray, "3"]
    high: Float[np.ndarray, "3"]
    frame: Frame
    symmetry: Symmetry


def make_scan_target(mesh: Mesh, model_id: str, seed: int, views: int = 1, own_size: bool = False) -> ScanTarget:
    """Scan a mesh (y up, front +z, any unit) virtually; depends on the mesh, its id and the other arguments alone.

    Args:
        views: how many cameras see it; 0 sees the whole surface.
        own_size: whether the object stands there in the mesh's own size and unit, only turned and moved.

    Raises:
        MeshError: no face of the mesh has an area.
    """
    prepared = prepare_mesh(mesh, model_id, seed)
    vertices, faces = prepared.vertices, torch.from_numpy(prepared.mesh.faces).long()
    generator = torch.Generator().manual_seed(zlib.crc32(f"scan {seed} {zlib.crc32(model_id.encode())}".encode()))
    surface = _array(sample_surface(vertices, faces, _SURFACE_POINTS, generator)[0])
    low, high = vertices.amin(0), vertices.amax(0)
    parts = []
    for _ in range(max(views, 1)):
        camera = random_camera(generator)
        if views:
            seen = depth_scan(vertices, faces, camera, POINTS, generator=generator)
        else:
            seen = torch.from_numpy(surface[-POINTS:]).float()
        parts.append((seen, degraded(seen, camera, low, high, generator)))
    visible, scanned = (torch.cat(clouds) for clouds in zip(*parts, strict=True))
    frame = random_frame(generator)
    if views > 1:
        chosen = torch.randperm(len(scanned), generator=generator)[:POINTS]
        visible, scanned = visible[chosen], scanned[chosen]
    known = _array(scanned).clip(-_REACH, _REACH)
    if own_size:
        frame = replace(frame, scale=prepared.frame.scale)
    return ScanTarget(
        model_id=model_id,
        scan=frame.from_unit(known),
        known=known,
        visible=_array(visible),
        whole=surface[:POINTS],
        low=_array(low),
        high=_array(high),
        frame=frame,
        symmetry=vertical_symmetry(surface),
    )


def random_camera(generator: torch.Generator) -> Float[Tensor, "3"]:
    """Draw where the camera stands in the unit box; it looks at the middle."""
    azimuth, elevation, distance = torch.rand(3, generator=generator).tolist()
    azimuth *= 2 * math.pi
    elevation = math.radians(_between(ELEVATION, elevation))
    # The longest side of a unit box is 2.
    distance = 2 * _between(DISTANCE, distance)
    level = distance * math.cos(elevation)
    return torch.tensor([level * math.sin(azimuth), distance * math.sin(elevation), level * math.cos(azimuth)])


def degraded(
    seen: Float[Tensor, "points 3"],
    camera: Float[Tensor, "3"],
    low: Float[Tensor, "3"],
    high: Float[Tensor, "3"],
    generator: torch.Generator,
) -> Float[Tensor, "points 3"]:
    """Add random amounts of noise and outliers to points, unit box; `low`, `high`: the object's box."""
    noise, outliers = (torch.rand(2, generator=generator) * torch.tensor([NOISE, OUTLIERS])).tolist()
    ray = torch.nn.functional.normalize(seen - camera, dim=1)
    points = seen + ray * noise * torch.randn(len(seen), 1, generator=generator)
    # The points are in random order, so that the first ones are a random choice.
    stray = round(outliers * len(seen))
    box = (torch.rand(stray, 3, generator=generator) - 0.5) * OUTLIER_BOX * (high - low) + (low + high) / 2
    return torch.cat([box, points[stray:]])


def random_frame(generator: torch.Generator) -> Frame:
    """Draw where the object stands: upright, rotated about y."""
    turn, size, *offset = torch.rand(5, generator=generator, dtype=torch.float64).tolist()
    return Frame(
        center=(np.array(offset) * 2 - 1) * OFFSET,
        scale=_between(LONGEST_SIDE, size) / 2,
        rotation=yaw_rotation(2 * math.pi * turn),
    )


def _between(limits: tuple[float, float], fraction: float) -> float:
    low, high = limits
    return low + (high - low) * fraction


def _array(points: Tensor) -> np.ndarray:
    return np.asarray(points.double().numpy())
