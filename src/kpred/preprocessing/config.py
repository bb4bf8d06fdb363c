"""Settings of cleaning; they need no other package, so that the command line shows them at once."""

from __future__ import annotations

from dataclasses import dataclass

from kpred.errors import ConfigError

LEAST_POINTS = 64
"""Cleaning never leaves fewer points than a fit needs."""


@dataclass(frozen=True)
class CleanConfig:
    """Which steps of cleaning are taken, and how. All lengths are relative to the scan, whatever its unit.

    Attributes:
        duplicates: remove exact repeats.
        outliers: remove strays, points farther than `outlier_ratio` times what is usual around from their neighbours,
            and islands, components of at most `island_share` of all points, if they are far from the rest (those of
            at most `speck_share` need not be that far).
        floor: remove a piece of the floor, if outside of the object's footprint it covers at least `floor_beyond` of
            the footprint's area.
        wall: remove a piece of a wall, if it reaches beyond the object on two sides by at least `wall_beyond` of the
            scan's size.
        density: thin to an even surface density, to no fewer than `points`.
        normals: estimate normals from `normal_neighbours` neighbours.
    """

    duplicates: bool = True
    outliers: bool = True
    outlier_ratio: float = 2.5
    speck_share: float = 0.004
    island_share: float = 0.03
    floor: bool = True
    floor_beyond: float = 0.06
    wall: bool = True
    wall_beyond: float = 0.04
    density: bool = True
    points: int = 2048
    normals: bool = False
    normal_neighbours: int = 12

    def __post_init__(self) -> None:
        for name in ("outlier_ratio", "speck_share", "island_share", "floor_beyond", "wall_beyond"):
            if not getattr(self, name) > 0:
                raise ConfigError(f"Cleaning setting {name} must be positive, but is {getattr(self, name)}.")
        if self.points < LEAST_POINTS or self.normal_neighbours < 4:
            raise ConfigError(
                f"Cleaning must keep at least {LEAST_POINTS} points and use at least 4 neighbours for normals, but is "
                f"set to {self.points} points and {self.normal_neighbours} neighbours."
            )
