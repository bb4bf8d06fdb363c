"""Depth images of dense clouds: what a camera sees of them, and which places it would see."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn import functional

from kpred.ops.typing import Bool, Float

SLANT = 1.5
"""Depth, in pixel widths, that the surface in one pixel may span."""


@dataclass(frozen=True, eq=False)
class CloudDepth:
    """Depth images of clouds, one a view; every image holds its whole cloud.

    Attributes:
        cameras, axes: positions, and rows right, up and forward, in the frame and unit of the clouds, y up.
        corner, width: least image coordinates of a view, and the side of its pixels, at unit focal length.
        depth: of the nearest surface in each pixel, row by row; infinite where there is none.
    """

    cameras: Float[Tensor, "views 3"]
    axes: Float[Tensor, "views 3 3"]
    corner: Float[Tensor, "views 1 2"]
    width: Float[Tensor, "views 1"]
    depth: Float[Tensor, "views pixels"]

    def sees(self, places: Float[Tensor, "views places 3"], tolerance: float = 0.0) -> Bool[Tensor, "views places"]:
        """Report places (frame and unit of the clouds) that are at most `tolerance` behind the nearest surface.

        A place in a pixel without surface, or outside the image, is seen.
        """
        plane, depth = _project(places, self.cameras, self.axes)
        resolution = round(self.depth.shape[1] ** 0.5)
        pixel = ((plane - self.corner) / self.width[..., None]).round()
        inside = ((pixel >= 0) & (pixel < resolution)).all(-1)
        column, row = pixel.clamp(0, resolution - 1).long().unbind(-1)
        nearest = torch.gather(self.depth, 1, row * resolution + column)
        return ~inside | (depth <= nearest + tolerance + SLANT * self.width * depth)


def render_depth(
    points: Float[Tensor, "views points 3"], cameras: Float[Tensor, "views 3"], resolution: int
) -> CloudDepth:
    """Render depth images (resolution x resolution pixels) of dense clouds; cameras look at the middles of the boxes.

    Gaps of one or two pixels are closed: clouds need a point of each surface in most pixels, not in every one.
    """
    middle = (points.amin(1) + points.amax(1)) / 2
    forward = functional.normalize(middle - cameras, dim=1)
    up = torch.zeros_like(forward)
    up[:, 1] = 1.0
    right = functional.normalize(torch.linalg.cross(forward, up, dim=1), dim=1)
    axes = torch.stack([right, torch.linalg.cross(right, forward, dim=1), forward], dim=1)
    plane, depth = _project(points, cameras, axes)
    corner = plane.amin(1, keepdim=True)
    width = (plane.amax(1, keepdim=True) - corner).amax(2).clamp(min=1e-9) / (resolution - 1)
    column, row = ((plane - corner) / width[..., None]).round().long().unbind(-1)
    inverse = torch.zeros(len(points), resolution * resolution, dtype=points.dtype, device=points.device)
    inverse.scatter_reduce_(1, row * resolution + column, 1 / depth, "amax")
    # A dilation and an erosion: holes between points close, outlines and slanted planes stay as they are.
    image = inverse.view(-1, 1, resolution, resolution)
    closed = -functional.max_pool2d(-functional.max_pool2d(image, 3, 1, 1), 3, 1, 1)
    return CloudDepth(cameras, axes, corner, width, 1 / closed.flatten(1))


def _project(points: Tensor, cameras: Tensor, axes: Tensor) -> tuple[Tensor, Tensor]:
    """Project to image coordinates (views, points, 2) at unit focal length, and depths (views, points)."""
    local = (points - cameras[:, None]) @ axes.mT
    depth = local[..., 2].clamp(min=1e-6)
    return local[..., :2] / depth[..., None], depth
