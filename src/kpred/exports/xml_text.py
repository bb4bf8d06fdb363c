"""Text of XML files: numbers, names, comments, quaternions."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any
from xml.etree import ElementTree as Xml

import numpy as np
from scipy.spatial.transform import Rotation

from kpred.ops.typing import Float

_FAR = 1e4
"""Beyond it nine digits are coarser than 0.01 mm."""


def numbers(values: Iterable[float]) -> str:
    """Write numbers with nine digits, places far from the origin with fifteen, separated by spaces."""
    return " ".join(f"{float(value):.{9 if abs(value) < _FAR else 15}g}" for value in values)


def xml_name(text: str) -> str:
    """Keep of a name what all readers of names take: letters, digits, underscores, dashes and dots."""
    return re.sub(r"[^A-Za-z0-9_.-]+", "_", text).strip("_") or "object"


def xml_comment(lines: Iterable[str]) -> Any:
    """Make a comment of lines; it may not hold two dashes."""
    return Xml.Comment(" " + "; ".join(lines).replace("--", "- -").rstrip("-") + " ")


def xml_bytes(root: Xml.Element) -> bytes:
    """Write a document with indentation."""
    Xml.indent(root)
    found: bytes = Xml.tostring(root, encoding="utf-8", xml_declaration=True)
    return found + b"\n"


def quaternion(rotation: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, "4"]:
    """Return the unit quaternion w, x, y, z of a rotation."""
    found: np.ndarray = Rotation.from_matrix(rotation).as_quat()[[3, 0, 1, 2]]
    return found


def roll_pitch_yaw(rotation: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, "3"]:
    """Return the angles about the fixed axes x, y, z (radians), as URDF and SDF have them."""
    found: np.ndarray = np.asarray(Rotation.from_matrix(rotation).as_euler("xyz"))
    return found
