"""Settings of cleaning, without imports, so that the command line loads them quickly."""

from __future__ import annotations

from dataclasses import dataclass

from kpred.errors import ConfigError

MIN_POINTS = 64
"""Minimum number of points that cleaning leaves, as a fit needs."""


@dataclass(frozen=True)
class CleanConfig:
    """Steps of cleaning and their settings; all lengths are relative to the scan's size.

    Attributes:
        duplicates: remove exact repeats.
        outliers: remove strays, points farther from their neighbours than `outlier_ratio` times the local spacing,
            and islands, components of at most `island_fraction` of all points, if they are far from the rest (those of
            at most `speck_fraction` need not be that far).
        floor: remove a piece of the floor, if outside of the object's footprint it covers at least `floor_beyond` of
            the footprint's area.
        wall: remove a piece of a wall, if it reaches beyond the object on two sides by at least `wall_beyond` of the
            scan's size.
        density: downsample to an even surface density, to at least `points` points.
        normals: estimate normals from `normal_neighbours` neighbours.
    """

    duplicates: bool = True
    outliers: bool = True
    outlier_ratio: float = 2.5
    speck_fraction: float = 0.004
    island_fraction: float = 0.03
    floor: bool = True
    floor_beyond: float = 0.06
    wall: bool = True
    wall_beyond: float = 0.04
    density: bool = True
    points: int = 2048
    normals: bool = False
    normal_neighbours: int = 12

    def __post_init__(self) -> None:
        for name in ("outlier_ratio", "speck_fraction", "island_fraction", "floor_beyond", "wall_beyond"):
            if not getattr(self, name) > 0:
                raise ConfigError(f"Cleaning setting {name} must be positive, but is {getattr(self, name)}.")
        if self.points < MIN_POINTS or self.normal_neighbours < 4:
            raise ConfigError(
                f"Cleaning must keep at least {MIN_POINTS} points and use at least 4 neighbours for normals, but is "
                f"set to {self.points} points and {self.normal_neighbours} neighbours."
            )
