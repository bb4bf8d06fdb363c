"""A small furnished room, as points with the object of each."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from kpred.synthetic.generator import generate

FURNITURE = {"chair": (-1.2, -0.6), "table": (0.6, 0.9), "cabinet": (1.3, -1.2)}
"""Where the objects stand, x and y in metres."""

SIZE = {"chair": 0.9, "table": 1.2, "cabinet": 1.6}
"""Longest side of each, metres."""


def _shell(rng: np.random.Generator) -> np.ndarray:
    """Sample the floor (5 m by 4 m) and two walls of 2.4 m at x = -2.5 and y = -2."""
    floor = np.column_stack([rng.uniform(-2.5, 2.5, 20_000), rng.uniform(-2, 2, 20_000), np.zeros(20_000)])
    west = np.column_stack([np.full(10_000, -2.5), rng.uniform(-2, 2, 10_000), rng.uniform(0, 2.4, 10_000)])
    south = np.column_stack([rng.uniform(-2.5, 2.5, 12_000), np.full(12_000, -2.0), rng.uniform(0, 2.4, 12_000)])
    points = np.concatenate([floor, west, south])
    return points + rng.normal(0.0, 0.002, points.shape)


@pytest.fixture(scope="session")
def empty_room() -> np.ndarray:
    """Points of a floor and two walls, metres, z up, floor at 0."""
    return _shell(np.random.default_rng(5))


@pytest.fixture(scope="session")
def furnished_room() -> tuple[np.ndarray, np.ndarray]:
    """Points (N, 3) of the room with furniture; (N,) row of the object in `FURNITURE`, -1 for floor and walls."""
    rng = np.random.default_rng(5)
    parts = [_shell(rng)]
    owner = [np.full(len(parts[0]), -1)]
    for row, (name, (x, y)) in enumerate(FURNITURE.items()):
        # Boards inside of a closed cabinet would not be scanned.
        mesh = trimesh.creation.box([0.9, 1.6, 0.45]) if name == "cabinet" else generate(name, 2, seed=11)[1]
        vertices = np.asarray(mesh.vertices, dtype=np.float64)
        vertices = vertices * SIZE[name] / np.ptp(vertices, axis=0).max()
        upright = np.column_stack([vertices[:, 0], -vertices[:, 2], vertices[:, 1]])
        upright += [x, y, -upright[:, 2].min()]
        points = trimesh.sample.sample_surface(trimesh.Trimesh(upright, mesh.faces, process=False), 6000, seed=row)[0]
        parts.append(points + rng.normal(0.0, 0.002, points.shape))
        owner.append(np.full(6000, row))
    return np.concatenate(parts), np.concatenate(owner)
