"""Targets: the shapes of a pack that are to be explained, as clouds in the known frame of their whole mesh."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import torch

from kpred.database.encode import POINTS, prepare_mesh
from kpred.errors import ConfigError, MeshError, PackError
from kpred.ops import sample_surface, slice_by_plane
from kpred.ops.occlusion import random_directions
from kpred.shapes.mesh import Mesh
from kpred.shapes.pack import MeshPack

Item = TypeVar("Item")


@dataclass(frozen=True, eq=False)
class Target:
    """One shape to be explained, in its unit box (known frame).

    Attributes:
        model_id: of the shape.
        points: (2048, 3) its surface; again: a second, independent sample of it.
        normal: (3,) of the plane that hides part of it; one plane for all occlusions, so that they can be compared.
    """

    model_id: str
    points: torch.Tensor
    again: torch.Tensor
    normal: torch.Tensor

    def visible(self, occlusion: float) -> torch.Tensor:
        """Return the points that remain when the plane hides a fraction of them; still in the whole shape's box."""
        seen = slice_by_plane(self.points[None], torch.tensor([occlusion]), self.normal[None])[0]
        return self.points[seen]


def make_target(mesh: Mesh, model_id: str, seed: int) -> Target:
    """Sample a mesh; depends on the mesh, its id and the seed alone.

    Raises:
        MeshError: no face of the mesh has an area.
    """
    prepared = prepare_mesh(mesh, model_id, seed)
    # Another stream than that of database models: a shape that is in both is not compared with its own sample.
    generator = torch.Generator().manual_seed(zlib.crc32(f"target {seed} {zlib.crc32(model_id.encode())}".encode()))
    faces = torch.from_numpy(prepared.mesh.faces).long()
    points, _ = sample_surface(prepared.vertices, faces, POINTS, generator)
    # Scans come in any order; the sample comes face by face.
    points = points[torch.randperm(len(points), generator=generator)]
    again, _ = sample_surface(prepared.vertices, faces, POINTS, generator)
    return Target(model_id, points, again, random_directions(1, generator)[0])


def read_targets(
    pack: MeshPack,
    name: str,
    split: str,
    limit: int | None,
    seed: int,
    report: Callable[[str], None],
    only: Collection[str] | None = None,
) -> list[Target]:
    """Read the targets of one split; with `limit` a random subset by seed, nested in a larger limit's.

    With `only`, those of these ids alone.

    Shapes without a surface go to `report` as one sentence and are left out.

    Raises:
        PackError: the pack has no shape with a surface in this split.
        ConfigError: the limit is below 1.
    """
    targets = []
    for row in chosen_rows(pack, split, limit, seed, only):
        try:
            targets.append(make_target(pack[row], str(pack.model_id[row]), seed))
        except MeshError as error:
            report(f"left out: {error}")
    if not targets:
        raise PackError(f"{name}: no shape of the split '{split}' has a surface; choose another split.")
    return targets


def chosen_rows(
    pack: MeshPack, split: str, limit: int | None, seed: int, only: Collection[str] | None = None
) -> list[int]:
    """Positions in the pack of one split's shapes; with `limit` a random subset by seed, nested in a larger limit's.

    With `only`, those of these ids alone.

    Raises:
        ConfigError: the limit is below 1.
    """
    rows = pack.indices(split)
    if only is not None:
        rows = rows[np.isin(pack.model_id[rows], list(only))]
    return limited([int(row) for row in rows], limit, seed)


def limited(items: Sequence[Item], limit: int | None, seed: int) -> list[Item]:
    """Draw at most `limit` of some items at random by seed, in their order; nested in what a larger limit draws.

    Raises:
        ConfigError: the limit is below 1.
    """
    if limit is None:
        return list(items)
    if limit < 1:
        raise ConfigError(f"The limit of targets must be at least 1, but is {limit}.")
    chosen = np.sort(np.random.default_rng(seed).permutation(len(items))[:limit])
    return [items[int(row)] for row in chosen]
