"""Plain values and JSON text of them, the same for every file and every command."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping
from dataclasses import asdict, is_dataclass
from pathlib import Path
from typing import Any

from kpred.atomic import atomic_path


def plain(value: Any) -> Any:
    """Convert dataclasses, arrays, tensors and paths to JSON's own types; NaN and infinity become null.

    Raises:
        TypeError: JSON has no form for a value.
    """
    if is_dataclass(value) and not isinstance(value, type):
        return plain(asdict(value))
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple | set | frozenset):
        return [plain(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, str | int | bool):
        return value
    if isinstance(value, Path):
        return str(value)
    raise TypeError(f"{type(value).__name__} cannot be written as JSON")


def json_text(value: Any, indent: int = 2) -> str:
    """Write a value as JSON text that ends with a line break."""
    return json.dumps(plain(value), indent=indent, allow_nan=False) + "\n"


def write_json(path: str | os.PathLike[str], value: Any, indent: int = 2) -> None:
    """Write a value as a JSON file, whole or not at all.

    Raises:
        OutputError: the file cannot be written there.
    """
    with atomic_path(path) as temporary:
        temporary.write_text(json_text(value, indent), encoding="utf-8")
