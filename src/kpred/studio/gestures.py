"""Gestures: what a person may do to a fit, each one small, immutable and writable as JSON."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any, Literal, get_args

from kpred.errors import ConfigError
from kpred.ops.rotations import UP_AXES
from kpred.refinement.config import Deform
from kpred.shapes.unit_name import UNIT_NAMES, UnitName

Vector = tuple[float, float, float]
Axis = Literal["x", "y", "z"]
UnitChoice = UnitName | Literal["auto"]

AUTO = "auto"
"""Value of a correction that leaves the decision to the fit again."""

WHOLE = -1
"""Number that stands for the whole object where a part is named."""

MAX_COORDINATE = 1e18
"""Numbers of a gesture are no larger: products of two stay finite."""


@dataclass(frozen=True)
class ChooseCategory:
    """Fit again among the models of one category; `auto`: among all."""

    category: str


@dataclass(frozen=True)
class ChooseUp:
    """Fit again with this up axis of the scan."""

    up: str

    def __post_init__(self) -> None:
        if self.up not in (AUTO, *UP_AXES):
            raise ConfigError(f"The up axis must be auto or one of {', '.join(UP_AXES)}, but is '{self.up}'.")


@dataclass(frozen=True)
class Turn:
    """Fit again with the object's front turned about its up axis, from +z towards +x of the object."""

    degrees: float


@dataclass(frozen=True)
class ChooseDeform:
    """Fit again with another limit of how far models may be changed."""

    deform: Deform

    def __post_init__(self) -> None:
        if self.deform not in get_args(Deform):
            raise ConfigError(f"The deform mode must be one of {', '.join(get_args(Deform))}, but is '{self.deform}'.")


@dataclass(frozen=True)
class ChooseUnit:
    """Take the scan's lengths for metres, centimetres, ...; `auto`: guess it from the object's size."""

    unit: UnitChoice

    def __post_init__(self) -> None:
        if self.unit not in (AUTO, *UNIT_NAMES):
            raise ConfigError(f"The unit must be auto or one of {', '.join(UNIT_NAMES)}, but is '{self.unit}'.")


@dataclass(frozen=True)
class Crop:
    """Keep the points of the scan inside of a box, and fit again.

    Attributes:
        low, high: corners along the box's own axes; axes: its three directions as rows, scan's frame, orthonormal.
    """

    low: Vector
    high: Vector
    axes: tuple[Vector, Vector, Vector] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))

    def __post_init__(self) -> None:
        if not all(low < high for low, high in zip(self.low, self.high, strict=True)):
            raise ConfigError("The box of a crop is empty; each of its sides must be longer than nothing.")
        for row, one in enumerate(self.axes):
            for column, other in enumerate(self.axes):
                product = sum(a * b for a, b in zip(one, other, strict=True))
                if abs(product - (row == column)) > 1e-6:
                    raise ConfigError("The axes of a crop's box must be orthonormal.")


@dataclass(frozen=True)
class ChooseModel:
    """Replace the result by another model of the database, in the pose that was found."""

    model_id: str


@dataclass(frozen=True)
class MoveKeypoint:
    """Move a keypoint and what belongs to it; it is pinned there.

    Attributes:
        keypoint: its number; place: where to, scan's frame and unit.
        mirror: whether the keypoint on the other side moves alike; axis: the only axis of the object to move along.
    """

    keypoint: int
    place: Vector
    mirror: bool = False
    axis: Axis | None = None

    def __post_init__(self) -> None:
        if self.axis not in (None, *get_args(Axis)):
            raise ConfigError(f"The axis of a moved keypoint must be x, y or z, but is '{self.axis}'.")


@dataclass(frozen=True)
class PinKeypoint:
    """Pin a keypoint where it is, or release it."""

    keypoint: int
    pinned: bool


@dataclass(frozen=True)
class SetSize:
    """Give a part, or the whole object, a length along one axis of the object.

    Attributes:
        part: its number, or `WHOLE`; axis: x (width), y (height) or z (depth); length: scan's unit.
    """

    part: int
    axis: Axis
    length: float

    def __post_init__(self) -> None:
        if self.axis not in get_args(Axis):
            raise ConfigError(f"The axis of a size must be x, y or z, but is '{self.axis}'.")
        if not self.length > 0:
            raise ConfigError(f"A size must be a positive length, but is {self.length:g}.")


@dataclass(frozen=True)
class RefitRest:
    """Fit the shape to the scan again; pinned keypoints and typed sizes stay."""


Gesture = (
    ChooseCategory
    | ChooseUp
    | Turn
    | ChooseDeform
    | ChooseUnit
    | Crop
    | ChooseModel
    | MoveKeypoint
    | PinKeypoint
    | SetSize
    | RefitRest
)

KINDS: dict[str, type[Gesture]] = {kind.__name__: kind for kind in get_args(Gesture)}


def to_json(gesture: Gesture) -> dict[str, Any]:
    """Write a gesture as plain values; `gesture` names its kind."""
    return {"gesture": type(gesture).__name__, **asdict(gesture)}


def from_json(value: object) -> Gesture:
    """Read a gesture from plain values of any origin.

    Raises:
        ConfigError: unknown kind, missing or unknown fields, or values that cannot be.
    """
    if not isinstance(value, Mapping):
        raise ConfigError("A gesture must be an object with the field 'gesture'.")
    name = value.get("gesture")
    kind = KINDS.get(name) if isinstance(name, str) else None
    if kind is None:
        raise ConfigError(f"There is no gesture {str(name)[:40]!r}; the known ones are {', '.join(KINDS)}.")
    given = {key: one for key, one in value.items() if key != "gesture"}
    types = {one.name: str(one.type) for one in fields(kind)}
    if unknown := [str(key)[:40] for key in given if key not in types]:
        raise ConfigError(f"The gesture {kind.__name__} has no field {unknown[0]!r}.")
    try:
        return kind(**{key: _checked(types[key], one) for key, one in given.items()})
    except (TypeError, ValueError) as error:
        raise ConfigError(f"The gesture {kind.__name__} has a missing field or a value of a wrong type.") from error


def _checked(kind: str, value: Any) -> Any:
    """Convert one value to the annotated type, or raise ValueError."""
    if kind == "float":
        return _number(value)
    if kind == "Vector":
        return _vector(value)
    if kind.startswith("tuple[Vector"):
        rows = tuple(_vector(row) for row in value)
        if len(rows) != 3:
            raise ValueError(value)
        return rows
    types = {"int": int, "bool": bool, "str": str, "Axis | None": str | None}
    if not isinstance(value, types.get(kind, str)) or (kind == "int" and isinstance(value, bool)):
        raise ValueError(value)
    return value


def _vector(value: Any) -> Vector:
    x, y, z = (_number(one) for one in value)
    return x, y, z


def _number(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(value)
    if not (math.isfinite(value) and abs(value) < MAX_COORDINATE):
        raise ValueError(value)
    return float(value)
