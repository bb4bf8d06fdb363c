"""Training data: from mesh packs to clouds, cages and mean value coordinates, computed once and kept on the device."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor

from kpred.errors import MeshError, PackError, ScanError
from kpred.nn import KPRed
from kpred.ops import icosphere, mean_value_coordinates, sample_surface, unit_box_frame
from kpred.ops.typing import Float
from kpred.shapes.pack import MeshPack
from kpred.training.augmentation import box_of, random_factors, random_views, to_unit_box

POOL_POINTS = 16384
"""Points kept per shape; every step draws its targets from them, and what a camera sees of them."""

HULL_POINTS = 4096
"""Points of a source, of which its cage is made."""

Progress = Callable[[str, int, int], None]
"""Called with (what is being done, done, total)."""


@dataclass(frozen=True, eq=False)
class TrainingData:
    """Shapes of one category in their unit boxes, with the constants that depend on each shape alone.

    Attributes:
        pool: (shapes, POOL_POINTS, 3) surface points in random order, half precision.
        sources: indices of the shapes that are deformed; targets: those that are deformed to.
        points: (sources, P, 3) the fixed points of each source.
        cages: (sources, cage vertices, 3); weights: (sources, P, cage vertices) mean value coordinates, half precision;
            both have no vertices where no network was given.
        model_ids: of the shapes.
    """

    pool: Tensor
    sources: Tensor
    targets: Tensor
    points: Tensor
    cages: Tensor
    weights: Tensor
    model_ids: tuple[str, ...] = ()

    @property
    def device(self) -> torch.device:
        """Where all of it lies."""
        return self.pool.device

    def draw_targets(
        self, count: int, points: int, stretch: float, generator: torch.Generator
    ) -> Float[Tensor, "count points 3"]:
        """Draw targets: fresh points from the pool, mirrored and stretched at random, in own unit boxes."""
        chosen = self.targets[_integers(len(self.targets), count, generator, self.device)]
        clouds = self.clouds(chosen, points, generator)
        return to_unit_box(clouds * random_factors(count, stretch, generator)) if stretch > 1 else clouds

    def draw_scanned_targets(
        self, count: int, points: int, stretch: float, generator: torch.Generator
    ) -> tuple[Float[Tensor, "count points 3"], Float[Tensor, "count points 3"]]:
        """Draw targets as `draw_targets`, each with its depth view, in the target's unit box."""
        chosen = self.targets[_integers(len(self.targets), count, generator, self.device)]
        dense = self.pool[chosen].float() * random_factors(count, stretch, generator)
        scans, clouds = random_views(dense, points, generator), self._block(dense, points, generator)
        middle, half = box_of(clouds)
        return (clouds - middle) / half, (scans - middle) / half

    def clouds(self, rows: Tensor, points: int, generator: torch.Generator) -> Float[Tensor, "count points 3"]:
        """Draw fresh points of the shapes of these rows of the pool."""
        return self._block(self.pool[rows], points, generator).float()

    def _block(self, dense: Tensor, points: int, generator: torch.Generator) -> Tensor:
        # Points lie in random order, so that any block of them is a fair sample.
        start = _integers(POOL_POINTS, len(dense), generator, self.device)
        pick = (start[:, None] + torch.arange(points, device=self.device)) % POOL_POINTS
        return torch.gather(dense, 1, pick[..., None].expand(-1, -1, 3))

    def draw_sources(self, count: int, generator: torch.Generator) -> Tensor:
        """Draw random rows of `points`, `cages` and `weights`."""
        return _integers(len(self.sources), count, generator, self.device)


def prepare(
    packs: list[MeshPack],
    network: KPRed | None,
    points: int,
    seed: int,
    device: torch.device | str = "cpu",
    source_split: str | None = None,
    progress: Progress | None = None,
    batch: int = 16,
) -> TrainingData:
    """Sample every shape of the splits `source` and `train`, and compute cages and coordinates of the sources.

    Args:
        network: makes the cages; None leaves them out.
        source_split: split whose shapes are deformed (`source` in the paper); None deforms the shapes of both splits,
            since no training split is ever searched at test time.

    Raises:
        PackError: if fewer than two usable shapes remain.
    """
    generator = torch.Generator(device=device).manual_seed(seed)
    clouds: list[Tensor] = []
    vertices: list[Tensor] = []
    is_source: list[bool] = []
    names: list[str] = []
    total = sum(len(pack) for pack in packs)
    for pack in packs:
        for index in range(len(pack)):
            split = str(pack.split[index])
            if progress:
                progress("sampling shapes", len(clouds), total)
            if split not in ("source", "train"):
                continue
            mesh = pack[index]
            try:
                frame = unit_box_frame(mesh.vertices)
                corners = torch.from_numpy(frame.to_unit(mesh.vertices)).float().to(device)
                faces = torch.from_numpy(mesh.faces).long().to(device)
                cloud, _ = sample_surface(corners, faces, POOL_POINTS, generator)
            except (MeshError, ScanError):  # without area, or without size
                continue
            clouds.append(cloud.half())
            names.append(str(pack.model_id[index]))
            is_source.append(source_split is None or split == source_split)
            vertices.append(corners)
    if sum(is_source) < 2:
        raise PackError(
            "The mesh packs hold fewer than two shapes to train on; give packs with splits source and train."
        )
    pool = torch.stack(clouds)
    sources = torch.tensor(is_source, device=device).nonzero().squeeze(1)
    cages, weights = pool.new_zeros(len(sources), 0, 3).float(), pool.new_zeros(len(sources), points, 0)
    if network is not None:
        cages, weights = _cages(network, pool, sources, vertices, points, batch, progress)
    return TrainingData(
        pool=pool,
        sources=sources,
        targets=torch.arange(len(pool), device=device),
        points=pool[sources, :points].float(),
        cages=cages,
        weights=weights,
        model_ids=tuple(names),
    )


def _cages(
    network: KPRed,
    pool: Tensor,
    sources: Tensor,
    vertices: list[Tensor],
    points: int,
    batch: int,
    progress: Progress | None,
) -> tuple[Tensor, Tensor]:
    """Compute cages of the sources and their points' coordinates, as `TrainingData` has them."""
    faces = icosphere(network.config.cage_subdivisions)[1].to(pool.device)
    cages: list[Tensor] = []
    weights: list[Tensor] = []
    for rows in sources.split(batch):
        if progress:
            progress("cages and mean value coordinates", sum(len(c) for c in cages), len(sources))
        # The cage must hold the mesh's vertices too, which the sample may miss.
        hull = torch.stack([_with_vertices(pool[row, :HULL_POINTS].float(), vertices[int(row)]) for row in rows])
        cage = network.cage(hull)
        cages.append(cage)
        weights.append(mean_value_coordinates(pool[rows, :points].float(), cage, faces).half())
    return torch.cat(cages), torch.cat(weights)


def _with_vertices(cloud: Tensor, vertices: Tensor, count: int = 1024) -> Tensor:
    """Replace a cloud's last points by up to `count` of the mesh's vertices, evenly chosen."""
    step = max(1, -(-len(vertices) // count))
    corners = vertices[::step]
    return torch.cat([cloud[: len(cloud) - len(corners)], corners])


def _integers(high: int, count: int, generator: torch.Generator, device: torch.device) -> Tensor:
    return torch.randint(0, high, (count,), generator=generator, device=device)
