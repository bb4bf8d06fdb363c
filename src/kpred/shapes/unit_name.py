"""Names of units of length, without imports, so that the command line loads them quickly."""

from __future__ import annotations

from typing import Literal, get_args

UnitName = Literal["m", "cm", "mm", "in", "ft"]

UNIT_NAMES: tuple[UnitName, ...] = get_args(UnitName)
