"""Training data: from mesh packs to clouds, cages and mean value coordinates, computed once and kept on the device."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

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
    """Shapes of one or several categories in their unit boxes, with the constants that depend on each shape alone.

    Attributes:
        pool: (shapes, POOL_POINTS, 3) surface points in random order, half precision.
        sources: indices of the shapes that are deformed; targets: those that are deformed to.
        points: (sources, P, 3) the fixed points of each source.
        cages: (sources, cage vertices, 3); weights: (sources, P, cage vertices) mean value coordinates, half precision;
            both have no vertices where no network was given.
        model_ids: of the shapes.
        categories: (shapes,) number of each shape's category; None where all are of one.
    """

    pool: Tensor
    sources: Tensor
    targets: Tensor
    points: Tensor
    cages: Tensor
    weights: Tensor
    model_ids: tuple[str, ...] = ()
    categories: Tensor | None = None

    @property
    def device(self) -> torch.device:
        """Where all of it lies."""
        return self.pool.device

    def draw_categories(self, count: int, generator: torch.Generator, alike: int = 1) -> Tensor | None:
        """Draw (count,) categories, runs of `alike` the same; None where all shapes are of one.

        A category is drawn with the root of its number of shapes: rare ones are seen often, common ones still more.
        """
        if self.categories is None:
            return None
        runs = -(-count // alike)
        drawn = torch.multinomial(self._target_blocks.sizes.float().sqrt(), runs, True, generator=generator)
        return drawn.repeat_interleave(alike)[:count]

    def draw_targets(
        self, count: int, points: int, stretch: float, generator: torch.Generator, categories: Tensor | None = None
    ) -> Float[Tensor, "count points 3"]:
        """Draw targets: fresh points from the pool, mirrored and stretched at random, in own unit boxes."""
        chosen = self.targets[self._target_blocks.draw(count, categories, generator)]
        clouds = self.clouds(chosen, points, generator)
        return to_unit_box(clouds * random_factors(count, stretch, generator)) if stretch > 1 else clouds

    def draw_scanned_targets(
        self, count: int, points: int, stretch: float, generator: torch.Generator, categories: Tensor | None = None
    ) -> tuple[Float[Tensor, "count points 3"], Float[Tensor, "count points 3"]]:
        """Draw targets as `draw_targets`, each with its depth view, in the target's unit box."""
        chosen = self.targets[self._target_blocks.draw(count, categories, generator)]
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

    def draw_sources(self, count: int, generator: torch.Generator, categories: Tensor | None = None) -> Tensor:
        """Draw random rows of `points`, `cages` and `weights`, of these categories where there are several."""
        return self._source_blocks.draw(count, categories, generator)

    @cached_property
    def _target_blocks(self) -> _Blocks:
        return _Blocks.of(self.targets, self.categories)

    @cached_property
    def _source_blocks(self) -> _Blocks:
        return _Blocks.of(self.sources, self.categories)


@dataclass(frozen=True, eq=False)
class _Blocks:
    """Rows ordered by category: those of category c are `order[starts[c] : starts[c] + sizes[c]]`."""

    order: Tensor
    starts: Tensor
    sizes: Tensor

    @classmethod
    def of(cls, shapes: Tensor, categories: Tensor | None) -> _Blocks:
        """Order the rows of `shapes` (indices of shapes) by the shapes' categories."""
        group = torch.zeros_like(shapes) if categories is None else categories[shapes]
        sizes = torch.bincount(group, minlength=0 if categories is None else int(categories.max()) + 1)
        return cls(torch.argsort(group, stable=True), sizes.cumsum(0) - sizes, sizes)

    def draw(self, count: int, categories: Tensor | None, generator: torch.Generator) -> Tensor:
        """Draw rows of these categories (count,), or of any."""
        if categories is None:
            return _integers(len(self.order), count, generator, self.order.device)
        lot = torch.rand(count, generator=generator, device=self.order.device)
        sizes = self.sizes[categories]
        return self.order[self.starts[categories] + (lot * sizes).long().clamp(max=sizes - 1)]


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
    kinds: list[str] = []
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
            kinds.append(pack.category)
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
        categories=_numbered(kinds, is_source, device),
    )


def _numbered(kinds: list[str], is_source: list[bool], device: torch.device | str) -> Tensor | None:
    """Return the number of each shape's category, or None where all are of one; each must have a source."""
    named = sorted(set(kinds))
    if len(named) == 1:
        return None
    lacking = sorted(set(named) - {kind for kind, usable in zip(kinds, is_source, strict=True) if usable})
    if lacking:
        raise PackError(f"The mesh packs of {', '.join(lacking)} hold no source; give some, or another source split.")
    return torch.tensor([named.index(kind) for kind in kinds], device=device)


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
