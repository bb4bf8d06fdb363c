"""Walls inside of rooms: corners reach ceiling and walls, partitions start at a wall and leave a way around."""

import numpy as np

from kpred.synthetic.rooms.interior_walls import interior_walls
from kpred.synthetic.rooms.room import OTHER

SIZE = np.array([5.0, 2.6, 4.0])


def test_corners_and_partitions_stand_at_the_walls() -> None:
    names = set()
    for seed in range(60):
        for item in interior_walls(SIZE, np.random.default_rng(seed)):
            names.add(item.name)
            vertices = item.placed_vertices()
            low, high = vertices.min(axis=0), vertices.max(axis=0)
            at_wall = np.isclose(low[[0, 2]], -SIZE[[0, 2]] / 2) | np.isclose(high[[0, 2]], SIZE[[0, 2]] / 2)
            assert item.category == OTHER
            assert at_wall.sum() >= (2 if item.name == "corner" else 1)
            assert np.isclose(low[1], 0.0) and high[1] <= SIZE[1]
            assert ((high - low)[[0, 2]] <= 0.56 * SIZE[[0, 2]]).all()
    assert names == {"corner", "partition"}
