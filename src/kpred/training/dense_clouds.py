"""Dense clouds of the shapes that networks of scans are trained on."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from kpred.errors import MeshError, ScanError
from kpred.ops import sample_surface, unit_box_frame
from kpred.ops.typing import Float
from kpred.shapes.mesh import Mesh
from kpred.shapes.pack import MeshPack
from kpred.training.data import POOL_POINTS, Progress

SPLITS = ("source", "train")


@dataclass(frozen=True, eq=False)
class SampledShape:
    """One shape of a pack, and its dense cloud (`POOL_POINTS`, 3), unit box, points in random order."""

    pack: MeshPack
    index: int
    cloud: Float[Tensor, "points 3"]


def sampled_shapes(
    packs: Sequence[MeshPack], generator: torch.Generator, device: torch.device | str, progress: Progress | None
) -> Iterator[SampledShape]:
    """Sample the shapes of the splits `source` and `train`; those without a surface are left out."""
    total, done = sum(len(pack) for pack in packs), 0
    for pack in packs:
        for index in range(len(pack)):
            done += 1
            if progress:
                progress("scanning shapes", done, total)
            if str(pack.split[index]) not in SPLITS:
                continue
            try:
                yield SampledShape(pack, index, dense_cloud(pack[index], POOL_POINTS, generator, device))
            except (ScanError, MeshError):
                continue


def dense_cloud(
    mesh: Mesh, count: int, generator: torch.Generator, device: torch.device | str = "cpu"
) -> Float[Tensor, "count 3"]:
    """Sample points (unit box) of a mesh's whole surface, inner faces included, in random order.

    Raises:
        ScanError, MeshError: if the mesh has no extent or no area.
    """
    frame = unit_box_frame(mesh.vertices)
    corners = torch.from_numpy(frame.to_unit(mesh.vertices)).float().to(device)
    faces = torch.from_numpy(mesh.faces).long().to(device)
    return sample_surface(corners, faces, count, generator)[0]
