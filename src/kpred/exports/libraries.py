"""Libraries of other tools: extras of the package, imported when a file is written."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from kpred.errors import OutputError


def check_library(module: str, extra: str, path: Path) -> None:
    """Refuse a file whose library is not installed.

    Raises:
        OutputError: it is not; the message names the extra.
    """
    if find_spec(module) is None:
        raise OutputError(f"Cannot write {path}: it needs the package {module}; pip install 'kpred[{extra}]'.")


def library(module: str, extra: str, path: Path) -> Any:
    """Import a module of an extra for a file.

    Raises:
        OutputError: it is not installed; the message names the extra.
    """
    check_library(module.partition(".")[0], extra, path)
    return import_module(module)
