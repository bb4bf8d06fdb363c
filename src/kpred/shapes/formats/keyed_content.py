"""What a small file of settings holds, whatever program wrote it: JSON, YAML, text of keys or of numbers, NumPy."""

from __future__ import annotations

import itertools
import json
import math
import re
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any

import numpy as np

from kpred.errors import ConfigError
from kpred.shapes.formats.scan_array import array_header
from kpred.shapes.formats.text_lines import open_lines
from kpred.shapes.reading import check_file, reading

TEXT_EXTENSIONS = (".txt", ".csv", ".pincam", ".cam", ".info", ".conf", ".ini")
EXTENSIONS = (*TEXT_EXTENSIONS, ".json", ".yaml", ".yml", ".npy", ".npz")

_MAX_BYTES = {".yaml": 1 << 18, ".yml": 1 << 18}
_MAX_OTHER = 1 << 26
"""Bytes of such a file; more are no settings of a camera."""

_MAX_DEPTH = 12
_MAX_ARRAYS = 64
_MAX_BRACKETS = 64
_KEYED = re.compile(r"\s*([A-Za-z_][\w. \-/]*?)\s*[=:]\s*(.+?)\s*$")


def read_keyed(file: Path, kind: str) -> Any:
    """Read a file as nested dictionaries and lists (.json, .yaml, text of `key = value` lines), or rows of words.

    Rows of words come from other text, one row as a flat list; a .npy file gives its array.

    Raises:
        ConfigError: missing, unreadable, too large, or of an unknown extension.
    """
    extension = file.suffix.lower()
    if extension not in EXTENSIONS:
        known = ", ".join(EXTENSIONS)
        raise ConfigError(f"{file}: unknown extension {file.suffix!r} of {kind}; use one of {known}.")
    check_file(file, ConfigError, f"{kind} file")
    if file.stat().st_size > _MAX_BYTES.get(extension, _MAX_OTHER):
        raise ConfigError(f"{file}: it is too large to be a file of {kind}; give the right file.")
    with reading(file, ConfigError, f"{extension} file of {kind}"):
        if extension == ".npy":
            with open(file, "rb") as stream:
                return _array(stream, str(file))
        if extension == ".npz":
            return _arrays(file)
        with open_lines(file) as lines:
            text = b"".join(lines).decode("utf-8")
        if extension == ".json" or text.lstrip()[:1] == "{":
            return json.loads(text)
        if extension in (".yaml", ".yml"):
            return _yaml(text)
        return _text(text)


def dictionaries(content: Any) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield all dictionaries in nested content, outer ones first, each with the keys that lead to it, in lower case."""
    waiting: list[tuple[str, Any, int]] = [("", content, 0)]
    while waiting:
        path, item, depth = waiting.pop(0)
        if isinstance(item, dict):
            yield path, item
            inner = [(f"{path}/{key}".lower(), value) for key, value in item.items()]
        elif isinstance(item, list) and len(item) < 1000:
            inner = [(path, value) for value in item]
        else:
            continue
        if depth < _MAX_DEPTH:
            waiting += [(name, value, depth + 1) for name, value in inner if isinstance(value, dict | list)]


def numbers(file: Path, content: Any) -> np.ndarray:
    """Convert numbers of nested lists to a float64 array.

    Raises:
        ConfigError: something else stands there, or rows differ in length.
    """
    try:
        found = np.array(content, dtype=np.float64)
    except (ValueError, TypeError, OverflowError, RecursionError) as error:
        raise ConfigError(f"{file}: its rows are not numbers of one matrix; write the matrix row by row.") from error
    return found


def _array(stream: IO[bytes] | zipfile.ZipExtFile, name: str) -> np.ndarray:
    shape, by_column, dtype = array_header(stream, name)
    if dtype.kind not in "fiu" or any(side > 4096 for side in shape) or len(shape) > 2:
        raise ConfigError(f"{name}: it holds {dtype} of shape {shape}, not one matrix; save the matrix again.")
    count = math.prod(shape)
    values = np.frombuffer(stream.read(count * dtype.itemsize), dtype, count)
    return np.reshape(values, shape, order="F" if by_column else "C")


def _arrays(file: Path) -> dict[str, Any]:
    """Read the matrices of an archive as lists by name; other arrays are left out."""
    found: dict[str, Any] = {}
    with zipfile.ZipFile(file) as archive:
        for name in archive.namelist()[:_MAX_ARRAYS]:
            with archive.open(name) as stream:
                try:
                    found[name.removesuffix(".npy")] = _array(stream, f"{file} ({name})").tolist()
                except ConfigError:
                    continue
    return found


def _yaml(text: str) -> Any:
    import yaml

    # OpenCV writes a header of its own and tags of its own, behind which stand plain values.
    plain = re.sub(r"^%YAML.*$", "", text, flags=re.MULTILINE).replace("!!opencv-matrix", "")
    # The parser's time is quadratic in the depth of brackets.
    depth = itertools.accumulate({"[": 1, "{": 1, "]": -1, "}": -1}.get(letter, 0) for letter in plain)
    if max(depth, default=0) > _MAX_BRACKETS:
        raise ValueError("nested too deeply")
    # Aliases can make little text expand without end.
    if any(isinstance(event, yaml.AliasEvent) for event in yaml.parse(plain, Loader=yaml.SafeLoader)):
        raise ValueError("aliases are not read")
    found = list(yaml.safe_load_all(plain))
    return found[0] if len(found) == 1 else found


def _text(text: str) -> Any:
    lines = [line.partition("#")[0].strip() for line in text.splitlines()]
    lines = [line for line in lines if line]
    matches = [_KEYED.match(line) for line in lines]
    keyed = {match.group(1): _value(match.group(2)) for match in matches if match is not None}
    if keyed and 2 * len(keyed) >= len(lines):
        return keyed
    # Brackets and the word `array` are what NumPy prints.
    rows = [re.sub(r"[,;\[\]()]|\barray\b", " ", line).split() for line in lines]
    rows = [row for row in rows if row]
    return rows[0] if len(rows) == 1 else rows


def _value(text: str) -> Any:
    """Parse a number, a list of numbers, or the text itself."""
    words = re.sub(r"[,;\[\](){}]", " ", text).split()
    try:
        found = [float(word) for word in words]
    except ValueError:
        return text
    return found[0] if len(found) == 1 else found
