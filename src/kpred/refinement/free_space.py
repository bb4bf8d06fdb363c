"""Space that the scanner looked through: where a result has surface, there is none.

From where it stood, the sensor saw the scan's points as a picture of depths over angles. A point of a result is in
seen-through space if all that the sensor saw around its direction lies farther away, by a margin. Directions in which
nothing was seen say nothing: the beam may have been lost.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from kpred.ops.nearest import nearest_neighbours
from kpred.ops.typing import Float

MARGIN = 0.1
"""What was seen must lie so much farther than a point for the point to be in seen-through space, unit box."""

PIXEL = 1.5
"""Width of a pixel against the median angle between a scan point and its nearest neighbour."""

MIN_SEEN = 2
"""So many scan points in a pixel and its neighbours make it seen: one alone may be a stray."""

MAX_PIXELS = 1024
"""Pixels along a side of the picture."""

WEIGHT, MAX_DEPTH = 0.3, 0.5
"""Of the mean squared depth of a result's points in seen-through space, and where it stops to grow, unit box: tuned on
depth scans of sa_partnet's split `train`, where the whole surface's error falls by 1 to 5 %.
"""


@dataclass(frozen=True, eq=False)
class DepthPicture:
    """Depths over azimuth and elevation around one sensor.

    Attributes:
        sensor: (3,); axes: (3, 3) rows right, up and forward, forward to the middle of the scan.
        corner: (2,) least azimuth and elevation; pixel: width of a pixel; radians.
        depth: (H, W) least distance from the sensor of the scan points in a pixel and its eight neighbours; infinite
            where fewer than `MIN_SEEN` are there.
    """

    sensor: Tensor
    axes: Tensor
    corner: Tensor
    pixel: float
    depth: Tensor

    @classmethod
    def of(cls, scan: Float[Tensor, "scan 3"], sensor: Float[Tensor, "3"]) -> DepthPicture:
        """Render the depth picture that a sensor has of a scan; both in one frame."""
        axes = _axes(scan.mean(0) - sensor)
        angles, distance = _angles(scan, sensor, axes)
        # The nearest of the other half of the points is found for one half.
        flat_angles = torch.nn.functional.pad(angles, (0, 1))
        squared, _ = nearest_neighbours(flat_angles[None, 1::2][:, :256], flat_angles[None, ::2])
        corner, extent = angles.amin(0), float((angles.amax(0) - angles.amin(0)).amax())
        pixel = max(PIXEL * float(squared.median().sqrt()), extent / MAX_PIXELS, 1e-6)
        column, row = ((angles - corner) / pixel).long().unbind(-1)
        height, width = int(row.max()) + 1, int(column.max()) + 1
        flat = row * width + column
        depth = torch.full((height * width,), torch.inf).scatter_reduce_(0, flat, distance, "amin")
        count = torch.zeros(height * width).scatter_add_(0, flat, torch.ones_like(distance))
        pool = torch.nn.functional.max_pool2d
        nearest = -pool(-depth.view(1, 1, height, width), 3, stride=1, padding=1)[0, 0]
        around = torch.nn.functional.avg_pool2d(count.view(1, 1, height, width), 3, 1, 1, divisor_override=1)[0, 0]
        return cls(sensor, axes, corner, pixel, torch.where(around >= MIN_SEEN, nearest, torch.inf))

    def beyond(self, points: Float[Tensor, "*batch 3"]) -> tuple[Float[Tensor, "*batch"], Float[Tensor, "*batch"]]:
        """Compute how much farther than each point the sensor saw in its direction, or 0, and the point's distance."""
        angles, distance = _angles(points, self.sensor, self.axes)
        place = torch.floor((angles - self.corner) / self.pixel).long()
        height, width = self.depth.shape
        column, row = place.unbind(-1)
        inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
        seen = self.depth[row.clamp(0, height - 1), column.clamp(0, width - 1)]
        farther = seen - distance
        return torch.where(inside & seen.isfinite() & (farther > MARGIN), farther, 0.0), distance


def depth_pictures(scan: Float[Tensor, "scan 3"], sensors: Float[Tensor, "sensors 3"]) -> list[DepthPicture]:
    """Render one depth picture a sensor; a scan point was seen by the sensor nearest to it."""
    owner = torch.cdist(scan, sensors).argmin(1)
    return [
        DepthPicture.of(scan[owner == row], sensor)
        for row, sensor in enumerate(sensors)
        if int((owner == row).sum()) >= 16
    ]


def seen_through(
    points: Float[Tensor, "candidates points 3"], scan: Float[Tensor, "scan 3"], sensors: Float[Tensor, "sensors 3"]
) -> Float[Tensor, "candidates points"]:
    """Compute how deep each point of a result lies in space that a sensor looked through; 0 where it may be.

    All in one frame, the unit box; the depth is along the ray, to the nearest that the sensor saw around it.
    """
    depth = points.new_zeros(points.shape[:-1])
    for picture in depth_pictures(scan, sensors):
        depth = torch.maximum(depth, picture.beyond(points)[0])
    return depth


def free_space_errors(
    points: Float[Tensor, "candidates points 3"], scan: Float[Tensor, "scan 3"], sensors: Float[Tensor, "sensors 3"]
) -> Float[Tensor, " candidates"]:
    """Compute the error that each result has for filling seen-through space; unit box squared."""
    return WEIGHT * seen_through(points, scan, sensors).clamp(max=MAX_DEPTH).square().mean(1)


def _axes(forward: Float[Tensor, "3"]) -> Float[Tensor, "3 3"]:
    """List the axes of a view as rows: right, up and forward."""
    forward = torch.nn.functional.normalize(forward, dim=0)
    upward = forward.new_tensor([0.0, 1.0, 0.0] if abs(float(forward[1])) < 0.95 else [1.0, 0.0, 0.0])
    right = torch.nn.functional.normalize(torch.linalg.cross(upward, forward), dim=0)
    return torch.stack([right, torch.linalg.cross(forward, right), forward])


def _angles(points: Tensor, sensor: Tensor, axes: Tensor) -> tuple[Tensor, Tensor]:
    """Azimuth and elevation (..., 2) of points around the sensor, radians, and their distances (...)."""
    local = (points - sensor) @ axes.T
    distance = local.norm(dim=-1).clamp(min=1e-9)
    azimuth = torch.atan2(local[..., 0], local[..., 2])
    elevation = torch.asin((local[..., 1] / distance).clamp(-1, 1))
    return torch.stack([azimuth, elevation], dim=-1), distance
