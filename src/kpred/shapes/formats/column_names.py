"""Which columns of a table of points hold the coordinates, by the names that programs and surveyors give them."""

from __future__ import annotations

import re
from collections.abc import Sequence

_TRIPLES: tuple[tuple[tuple[str, ...], ...], ...] = (
    (("x",), ("y",), ("z",)),
    (("points:0", "points_0", "points0"), ("points:1", "points_1", "points1"), ("points:2", "points_2", "points2")),
    (("coords:0", "coords_0", "coord_0"), ("coords:1", "coords_1", "coord_1"), ("coords:2", "coords_2", "coord_2")),
    (("x",), ("y",), ("h", "height", "elevation", "elev", "altitude", "alt", "hoehe", "höhe")),
    (("px",), ("py",), ("pz",)),
    (("position:0", "position_0"), ("position:1", "position_1"), ("position:2", "position_2")),
    (
        ("easting", "east", "e", "rechtswert", "ost", "ostwert"),
        ("northing", "north", "n", "hochwert", "nord", "nordwert"),
        ("height", "elevation", "altitude", "z", "h", "alt", "elev", "hoehe", "höhe", "up", "u"),
    ),
)

_AFFIXES = (
    "cartesian",
    "center",
    "centre",
    "centroid",
    "coordinate",
    "coordinates",
    "coord",
    "coords",
    "position",
    "positions",
    "pos",
    "point",
    "points",
    "pt",
    "p",
    "location",
    "loc",
    "vertex",
    "world",
    "local",
    "global",
    "utm",
    "value",
    "axis",
    "m",
    "mm",
    "cm",
    "meter",
    "meters",
    "metre",
    "metres",
)


def name_columns(values: Sequence[bytes]) -> tuple[int, int, int] | None:
    """Find the columns of x, y and z in a line of names; None where it holds no such names.

    Case, quotes, units in brackets and words such as "coordinate" do not count: `"X [m]"`, `pos_x`, `Points:0`,
    `Easting`.
    """
    if len(values) < 3 or len(values) > 4096:
        return None
    plain = [_plain(_decoded(value)) for value in values]
    for names in (plain, [_stripped(name) for name in plain]):
        for triple in _TRIPLES:
            found = [next((names.index(name) for name in axis if name in names), None) for axis in triple]
            if None not in found and len(set(found)) == 3:
                x, y, z = (column for column in found if column is not None)
                return x, y, z
    return None


def _decoded(value: bytes) -> str:
    try:
        return value.decode("utf-8")
    except UnicodeDecodeError:
        return value.decode("latin-1")


def _plain(name: str) -> str:
    """Lower case, without quotes, comment marks and units in brackets; cartesianX becomes cartesian_x."""
    bare = name.strip().strip("\"'").strip().lstrip("#/%")
    return re.sub(r"[\[(].*?[\])]", "", re.sub(r"(?<=[a-z])(?=[XYZ]$)", "_", bare).lower()).strip()


def _stripped(name: str) -> str:
    """Remove affixes that only mark a coordinate from the words of a name; normals have no coordinate."""
    words = [word for word in re.split(r"[\s_.\-]+", name) if word]
    left = [word for word in words if word not in _AFFIXES]
    return left[0] if len(left) == 1 and len(words) <= 4 else name
