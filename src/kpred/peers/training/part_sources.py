"""The sources of Uy et al. 2021: every shape of the split `source`, cut into parts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from kpred.errors import MeshError, PackError, ScanError
from kpred.ops import sample_surface, unit_box_frame
from kpred.ops.nearest import nearest_neighbours
from kpred.ops.typing import Float, Int
from kpred.peers.networks.part_boxes import PartBoxes
from kpred.shapes.mesh import Mesh, clean_mesh
from kpred.shapes.pack import MeshPack
from kpred.shapes.parts import part_labels
from kpred.training.data import Progress

POINTS = 2048
"""Points by which a source is cut into boxes and contacts are found."""

LABELLED_POINTS = 8192
"""Points of which the part is known for sure; given ones take that of the nearest."""


@dataclass(frozen=True, eq=False)
class PartSources:
    """S sources in their unit boxes: their ids, points (S, 2048, 3) and parts."""

    model_ids: tuple[str, ...]
    points: Tensor
    boxes: PartBoxes

    def to(self, device: torch.device | str) -> PartSources:
        """Move all arrays to a device."""
        return PartSources(self.model_ids, self.points.to(device), self.boxes.to(device))

    def some(self, rows: Int[Tensor, " rows"], count: int) -> tuple[Tensor, PartBoxes]:
        """Return the first points of the sources of these rows, (rows, count, 3), and their parts."""
        return self.points[rows, :count], self.boxes.take(rows).first(count)


def cut(mesh: Mesh, vertices: Tensor, points: Float[Tensor, "points 3"], parts: int) -> PartBoxes:
    """Cut a source's given points into at most `parts` parts.

    Args:
        mesh: cleaned, so that its parts are numbered alike in training and use; vertices: its own in the unit box.
    """
    label = torch.from_numpy(part_labels(mesh, parts))
    faces = torch.from_numpy(mesh.faces).long()
    dense, face = sample_surface(vertices, faces, LABELLED_POINTS, torch.Generator().manual_seed(0))
    _, nearest = nearest_neighbours(points[None], dense[None])
    return PartBoxes.of_shape(points, label[face[nearest[0]]], parts)


def read_part_sources(
    packs: Sequence[MeshPack], parts: int, seed: int, split: str = "source", progress: Progress | None = None
) -> PartSources:
    """Cut all shapes of the split into parts.

    Raises:
        PackError: if fewer than two usable shapes are in it, or two have one id.
    """
    names: list[str] = []
    clouds: list[Tensor] = []
    boxes: list[PartBoxes] = []
    chosen = [(pack, int(row)) for pack in packs for row in pack.indices(split)]
    generator = torch.Generator().manual_seed(seed)
    for done, (pack, row) in enumerate(chosen, start=1):
        name = str(pack.model_id[row])
        try:
            mesh = clean_mesh(replace(pack[row], name=name))
            vertices = torch.from_numpy(unit_box_frame(mesh.vertices).to_unit(mesh.vertices)).float()
            points, face = sample_surface(vertices, torch.from_numpy(mesh.faces).long(), POINTS, generator)
        except (MeshError, ScanError):  # without area, or without size
            continue
        names.append(name)
        clouds.append(points)
        boxes.append(PartBoxes.of_shape(points, torch.from_numpy(part_labels(mesh, parts))[face], parts))
        if progress:
            progress("cutting sources into parts", done, len(chosen))
    if len(names) < 2:
        raise PackError(
            f"The mesh packs hold fewer than two shapes in the split {split}; this peer deforms only these."
        )
    refuse_twins(names)
    return PartSources(tuple(names), torch.stack(clouds), PartBoxes.stack(boxes))


def refuse_twins(names: Sequence[str]) -> None:
    """Refuse duplicate ids, since shapes are identified by them later.

    Raises:
        PackError: if two shapes have one id.
    """
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise PackError(f"Two shapes of the training are called {twice}; give packs with ids of their own.")
