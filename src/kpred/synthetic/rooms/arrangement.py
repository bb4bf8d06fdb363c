"""A room in the making: what stands in it, and whether something more fits."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kpred.shapes.mesh import Mesh
from kpred.synthetic.rooms.catalogue import ROLES, Catalogue
from kpred.synthetic.rooms.occupancy import Occupancy, surface_points
from kpred.synthetic.rooms.room import OTHER, RoomObject, pose_of
from kpred.synthetic.rooms.shell import Wall

TALL = 0.95
"""Furniture higher than this (metres) does not stand before a window."""


class Arrangement:
    """What stands in a room; objects are added only where they meet nothing.

    Attributes:
        size: (3,) of the room, metres; walls: its walls; objects: what stands in it so far.
        surfaces: voxels with surface; solids: the same, and all that lies within closed furniture.
    """

    def __init__(
        self,
        size: np.ndarray,
        walls: Sequence[Wall],
        objects: Sequence[RoomObject],
        catalogue: Catalogue,
        rng: np.random.Generator,
    ) -> None:
        self.size, self.walls, self.objects = size, list(walls), list(objects)
        self.catalogue, self.rng = catalogue, rng
        self.surfaces, self.solids = Occupancy(size), Occupancy(size)
        self._spread: dict[int, tuple[Mesh, np.ndarray]] = {}
        for item in objects:
            if item.category == OTHER:
                self._occupy(item)

    def draw(self, role: str) -> Mesh:
        """Draw a shape for a role of `ROLES`."""
        return self.catalogue.draw(role, self.rng)

    def put(self, role: str, mesh: Mesh, pose: np.ndarray, close: float = 0.0, lift: float = 0.02) -> RoomObject | None:
        """Add furniture of a role if it meets nothing; None if it does not fit.

        Args:
            close: metres by which the shape is narrowed in plan for the test, for what is known to stand clear.
            lift: metres above its lowest point below which it may touch what it stands on.
        """
        # Some surfaces are black or glossy: little of them comes back.
        loss = float(self.rng.uniform(0.2, 0.7)) if self.rng.random() < 0.12 else 0.0
        item = RoomObject(mesh.name or role, ROLES[role].category, mesh, pose, loss)
        if not self.solids.fits(self._points(item, close), lift):
            return None
        self.objects.append(item)
        self._occupy(item)
        return item

    def put_small(self, name: str, mesh: Mesh, pose: np.ndarray, loss: float = 0.0) -> RoomObject | None:
        """Add a small thing on a surface or the floor, also within open furniture; None if it does not fit."""
        item = RoomObject(name, OTHER, mesh, pose, loss)
        points = self._points(item)
        if not self.surfaces.fits(points, lift=0.045):
            return None
        self.objects.append(item)
        self.surfaces.add(points)
        self.solids.add(points)
        return item

    def against_wall(
        self,
        role: str,
        mesh: Mesh,
        wall: Wall,
        middle: float,
        height: float = 0.0,
        gap: float = 0.02,
        close: float = 0.0,
    ) -> RoomObject | None:
        """Put furniture with its back to a wall, its middle at `middle` along it; openings are kept free."""
        low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
        half = float(high[0] - low[0]) / 2
        blocked = [*wall.doors, *(wall.windows if height + float(high[1]) > TALL else ())]
        if abs(middle) + half > wall.length / 2 or any(middle + half > a and middle - half < b for a, b in blocked):
            return None
        back = float(-low[2]) + gap
        turn = float(self.rng.normal(0.0, 0.012))
        # A thing that is turned needs room behind.
        back += abs(np.sin(turn)) * half
        return self.put(role, mesh, wall.pose @ pose_of(middle, height, back, 0.0 if close else turn), close)

    def anywhere(self, role: str, mesh: Mesh, tries: int = 12) -> RoomObject | None:
        """Put furniture somewhere on the floor, turned at random."""
        for _ in range(tries):
            reach = self.size[[0, 2]] / 2 - 0.3
            x, z = (float(self.rng.uniform(-side, side)) for side in reach)
            item = self.put(role, mesh, pose_of(x, 0.0, z, float(self.rng.uniform(0, 2 * np.pi))))
            if item is not None:
                return item
        return None

    def _points(self, item: RoomObject, close: float = 0.0) -> np.ndarray:
        key = id(item.mesh)
        if key not in self._spread:
            self._spread[key] = (item.mesh, surface_points(item.mesh))
        points = self._spread[key][1]
        if close > 0:
            half = np.maximum(np.ptp(item.box, axis=0) / 2, 1e-6) * [1.0, np.inf, 1.0]
            points = points * np.maximum(1.0 - close / half, 0.0)
        return np.asarray(points @ item.pose[:3, :3].T + item.pose[:3, 3])

    def _occupy(self, item: RoomObject) -> None:
        points = self._points(item)
        self.surfaces.add(points)
        self.solids.add(points)
        if item.category in ("cabinet", OTHER):
            self.solids.add(_inner_points(item))


def _inner_points(item: RoomObject) -> np.ndarray:
    """Return points all through an object's box, for closed or crowded objects."""
    low, high = item.box
    axes = [np.linspace(a, b, max(2, int((b - a) / 0.035) + 1)) for a, b in zip(low, high, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    return np.asarray(grid @ item.pose[:3, :3].T + item.pose[:3, 3])
