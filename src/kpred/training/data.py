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
from kpred.training.augmentation import box_of, random_depth_scans, random_factors, to_unit_box

POOL_POINTS = 4096
"""Points kept per shape; every step draws its targets from them."""

SCAN_POINTS = 1024
"""Points kept per depth scan."""

Progress = Callable[[str, int, int], None]
"""Called with (what is being done, done, total)."""


@dataclass(frozen=True, eq=False)
class TrainingData:
    """Shapes of one category in their unit boxes, with the constants that depend on each shape alone.

    Attributes:
        pool: (shapes, POOL_POINTS, 3) surface points.
        sources: indices of the shapes that are deformed; targets: those that are deformed to.
        scans: (shapes, views, points, 3) what a depth camera sees of each shape from random sides, in the unit box of
            the whole shape; no views unless the partial stage is trained.
        points: (sources, P, 3) the fixed points of each source.
        cages: (sources, cage vertices, 3); weights: (sources, P, cage vertices) mean value coordinates, half precision.
    """

    pool: Tensor
    scans: Tensor
    sources: Tensor
    targets: Tensor
    points: Tensor
    cages: Tensor
    weights: Tensor

    @property
    def device(self) -> torch.device:
        """Where all of it lies."""
        return self.pool.device

    def draw_targets(
        self, count: int, points: int, stretch: float, generator: torch.Generator
    ) -> Float[Tensor, "count points 3"]:
        """Random targets: fresh points from the pool, mirrored and stretched at random, in their own unit boxes."""
        chosen = self.targets[_integers(len(self.targets), count, generator, self.device)]
        clouds = self._fresh(chosen, points, generator)
        return to_unit_box(clouds * random_factors(count, stretch, generator)) if stretch > 1 else clouds

    def draw_scanned_targets(
        self, count: int, points: int, stretch: float, generator: torch.Generator
    ) -> tuple[Float[Tensor, "count points 3"], Float[Tensor, "count seen 3"]]:
        """Random targets as in `draw_targets`, each with one of its depth scans in the target's unit box."""
        chosen = self.targets[_integers(len(self.targets), count, generator, self.device)]
        view = _integers(self.scans.shape[1], count, generator, self.device)
        clouds, scans = self._fresh(chosen, points, generator), self.scans[chosen, view]
        factors = random_factors(count, stretch, generator)
        clouds, scans = clouds * factors, scans * factors
        middle, half = box_of(clouds)
        return (clouds - middle) / half, (scans - middle) / half

    def _fresh(self, chosen: Tensor, points: int, generator: torch.Generator) -> Tensor:
        pick = torch.rand(len(chosen), POOL_POINTS, generator=generator, device=self.device).argsort(1)[:, :points]
        return torch.gather(self.pool[chosen], 1, pick[..., None].expand(-1, -1, 3))

    def draw_sources(self, count: int, generator: torch.Generator) -> Tensor:
        """Random rows of `points`, `cages` and `weights`."""
        return _integers(len(self.sources), count, generator, self.device)


def prepare(
    packs: list[MeshPack],
    network: KPRed,
    points: int,
    seed: int,
    device: torch.device | str = "cpu",
    source_split: str | None = None,
    progress: Progress | None = None,
    batch: int = 16,
    views: int = 0,
) -> TrainingData:
    """Sample every shape of the splits `source` and `train`, and compute cages and coordinates of the sources.

    Args:
        source_split: split whose shapes are deformed (`source` in the paper); None deforms the shapes of both splits,
            since no training split is ever searched at test time.
        views: depth scans per shape, for the partial stage.

    Raises:
        PackError: if fewer than two usable shapes remain.
    """
    # Scans have a generator of their own: all stages see the same clouds, with scans or without.
    generator, scan_generator = torch.Generator().manual_seed(seed), torch.Generator().manual_seed(seed + 1)
    clouds: list[Tensor] = []
    scans: list[Tensor] = []
    vertices: list[Tensor] = []
    is_source: list[bool] = []
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
                corners = torch.from_numpy(frame.to_unit(mesh.vertices)).float()
                cloud, _ = sample_surface(corners, torch.from_numpy(mesh.faces).long(), POOL_POINTS, generator)
            except (MeshError, ScanError):  # without area, or without size
                continue
            shuffle = torch.randperm(POOL_POINTS, generator=generator)
            clouds.append(cloud[shuffle])
            scans.append(
                random_depth_scans(corners, torch.from_numpy(mesh.faces).long(), views, SCAN_POINTS, scan_generator)
            )
            is_source.append(source_split is None or split == source_split)
            vertices.append(corners)
    if sum(is_source) < 2:
        raise PackError(
            "The mesh packs hold fewer than two shapes to train on; give packs with splits source and train."
        )
    pool = torch.stack(clouds).to(device)
    sources = torch.tensor(is_source, device=device).nonzero().squeeze(1)
    faces = icosphere(network.config.cage_subdivisions)[1].to(device)
    cages: list[Tensor] = []
    weights: list[Tensor] = []
    for rows in sources.split(batch):
        if progress:
            progress("cages and mean value coordinates", sum(len(c) for c in cages), len(sources))
        # The cage must hold the mesh's vertices too, which the sample may miss.
        hull = torch.stack([_with_vertices(pool[row], vertices[int(row)].to(device)) for row in rows])
        cage = network.cage(hull)
        cages.append(cage)
        weights.append(mean_value_coordinates(pool[rows, :points], cage, faces).half())
    return TrainingData(
        pool=pool,
        scans=torch.stack(scans).to(device),
        sources=sources,
        targets=torch.arange(len(pool), device=device),
        points=pool[sources, :points].contiguous(),
        cages=torch.cat(cages),
        weights=torch.cat(weights),
    )


def _with_vertices(cloud: Tensor, vertices: Tensor, count: int = 1024) -> Tensor:
    """The cloud with its last points replaced by up to `count` of the mesh's vertices, spread over their order."""
    step = max(1, -(-len(vertices) // count))
    corners = vertices[::step]
    return torch.cat([cloud[: len(cloud) - len(corners)], corners])


def _integers(high: int, count: int, generator: torch.Generator, device: torch.device) -> Tensor:
    return torch.randint(0, high, (count,), generator=generator, device=device)
