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
        (*("easting", "east", "e", "rechtswert", "ost", "ostwert"), *("este", "est", "leste", "oost")),
        (*("northing", "north", "n", "hochwert", "nord", "nordwert"), *("norte", "noord")),
        (
            *("height", "elevation", "altitude", "z", "h", "alt", "elev", "hoehe", "höhe", "up", "u"),
            *("cota", "quota", "hoogte"),
        ),
    ),
)

_WORDS = re.compile(r"[a-zäöü]+")
_OTHER_MEANINGS = re.compile(
    r"n|nor|norm|normals?|v|vel|velocity|a|acc|accel|acceleration|linear|angular|r|rot|rotation|w|omega|q|quat|"
    r"quaternion|ori|orient|orientation|s|scale|size|g|gyro|mag|magnetic|b|d|delta|diff|dims?|dimensions?|extents?|"
    r"std|sigma|var|variance|cov|e|err|error|t|tan|tangent|binormal|dir|direction|angle|min|max|low|high|tex|texture|"
    r"uv|colou?r|col|offset|bbox|box|grid|voxel|index|idx|ind|id|pixel|pix|image|img|screen|cell|u|l|length|sensor|"
    r"origin|camera|cam|source|scanner|view|viewpoint|f|force|torque|moment|gradient|grad|curvature|flow|"
    r"displacement|disp|target|goal|start|end|parent|child"
)
"""Words beside x, y and z, or before 0, 1 and 2, that say that the column is no position."""

_POSITIONS = re.compile(r"points?|positions?|pos|coords?|locations?|xyz|vertex|p")

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
    return _by_pattern(plain)


def are_numbers_of_columns(values: Sequence[bytes]) -> bool:
    """Test whether names only number the columns: 0 1 2 (pandas), V1 V2 V3 (R), Var1 Var2 Var3 (MATLAB)."""
    if len(values) < 3:
        return False
    parts = [re.fullmatch(r"(\D*)(\d{1,4})", _plain(_decoded(value))) for value in values]
    if None in parts:
        return False
    found = [(part[1], int(part[2])) for part in parts if part is not None]
    first = found[0][1]
    return first in ((0, 1) if found[0][0] else (0,)) and found == [
        (found[0][0], first + step) for step in range(len(found))
    ]


def _by_pattern(names: Sequence[str]) -> tuple[int, int, int] | None:
    """Find the only three names that differ in x, y, z alone (`lidar_x`, `xpos`), or in numbers (`Location_1`)."""
    places = {name: number for number, name in reversed(list(enumerate(names)))}
    found = set()
    for name in places:
        for match in re.finditer(r"x|(?<!\d)[01](?!\d)", name):
            axes = {"x": "xyz", "0": "012", "1": "123"}[match[0]]
            triple = [name[: match.start()] + axis + name[match.end() :] for axis in axes]
            words = {word for part in (name[: match.start()], name[match.end() :]) for word in _WORDS.findall(part)}
            is_position = not any(map(_OTHER_MEANINGS.fullmatch, words))
            if match[0] != "x":
                is_position = is_position and any(map(_POSITIONS.fullmatch, words))
            if is_position and all(other in places for other in triple):
                found.add((places[triple[0]], places[triple[1]], places[triple[2]]))
    return found.pop() if len(found) == 1 else None


def _decoded(value: bytes) -> str:
    try:
        return value.decode("utf-8")
    except UnicodeDecodeError:
        return value.decode("latin-1")


def _plain(name: str) -> str:
    """Lower case, without quotes, comment marks and units in brackets; cartesianX becomes cartesian_x."""
    bare = re.sub(r"[\[(]([xyzXYZ012])[\])]", r":\1", name.strip().strip("\"'").strip().lstrip("#/%"))
    return re.sub(r"[\[(].*?[\])]", "", re.sub(r"(?<=[a-z])(?=[XYZ]$)", "_", bare).lower()).strip()


def _stripped(name: str) -> str:
    """Remove affixes that only mark a coordinate from the words of a name; normals have no coordinate."""
    words = [word for word in re.split(r"[\s_.\-]+", name) if word]
    left = [word for word in words if word not in _AFFIXES]
    return left[0] if len(left) == 1 and len(words) <= 4 else name
