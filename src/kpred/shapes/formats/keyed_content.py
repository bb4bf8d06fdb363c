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

TEXT_EXTENSIONS = (".txt", ".csv", ".pincam", ".cam", ".info", ".conf", ".ini", ".log")
EXTENSIONS = (*TEXT_EXTENSIONS, ".xml", ".json", ".yaml", ".yml", ".npy", ".npz")

_MAX_BYTES = {".yaml": 1 << 18, ".yml": 1 << 18}
_MAX_OTHER = 1 << 26
"""Bytes of such a file; more are no settings of a camera."""

_MAX_DEPTH = 12
_MAX_ARRAYS = 64
_MAX_BRACKETS = 64
_KEYED = re.compile(r"\s*([A-Za-z_][\w. \-/]*?)\s*[=:]\s*(.+?)\s*$")
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_LISTED = re.compile(rf"([A-Za-z_]\w*)((?:\s+{_NUMBER})+)$")
"""A name and its numbers: `intrinsics_matrix 1076 0 629 ...` (Matterport)."""

_PAIR = re.compile(rf"([A-Za-z_]\w*)\s*[=:]\s*({_NUMBER})(?![\w.])")
_REALSENSE = re.compile(rf"(\d+)x(\d+)\s+p\[({_NUMBER}) ({_NUMBER})\]\s+f\[({_NUMBER}) ({_NUMBER})\]")
"""Intrinsics as librealsense prints them."""

_XML = re.compile(r"<([A-Za-z_]\w{0,63})(?:\s[^<>]*)?>([^<>]{0,4096})</\1>")
_XML_DATA = re.compile(r"<([A-Za-z_]\w{0,63})\s[^<>]*opencv-matrix[^<>]*>((?:(?!</\1>).){0,8192})</\1>", re.DOTALL)


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
        if extension == ".xml":
            return _xml(text)
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


def _xml(text: str) -> dict[str, Any]:
    """Read the matrices and numbers that OpenCV writes as XML, without an XML parser and its entities."""
    matrices = {match[1]: dict(_XML.findall(match[2])) for match in _XML_DATA.finditer(text)}
    plain = {key: _value(value.strip()) for key, value in _XML.findall(_XML_DATA.sub("", text))}
    return plain | {key: _value(held.get("data", "")) for key, held in matrices.items()}


def _text(text: str) -> Any:
    lines = [line.partition("#")[0].strip() for line in text.splitlines()]
    lines = [line for line in lines if line]
    if any(re.fullmatch(r"\[[A-Za-z][\w .-]*\]", line) for line in lines):
        return _sections(lines)
    printed = _REALSENSE.search(text)
    if printed is not None:
        return dict(zip(("width", "height", "ppx", "ppy", "fx", "fy"), map(float, printed.groups()), strict=True))
    pairs = _PAIR.findall(lines[0]) if len(lines) == 1 else []
    if len(pairs) >= 4:
        return {key: float(value) for key, value in pairs}
    keyed = _keys(lines)
    if keyed and 2 * len(keyed) >= len(lines):
        return keyed
    # Brackets and the word `array` are what NumPy prints.
    rows = [re.sub(r"[,;\[\]()]|\barray\b", " ", line).split() for line in lines]
    rows = [row for row in rows if row]
    return rows[0] if len(rows) == 1 else rows


def _keys(lines: list[str]) -> dict[str, Any]:
    matches = [_KEYED.match(line) or _LISTED.match(line) for line in lines]
    return {match[1]: _value(match[2]) for match in matches if match is not None}


def _sections(lines: list[str]) -> dict[str, Any]:
    """Read the sections of an INI file: lines of keys and values, or names with the lines of their values below."""
    found: dict[str, dict[str, Any]] = {}
    section: dict[str, Any] = found.setdefault("", {})
    rows: list[float] = []
    for line in lines:
        if line.startswith("[") and line.endswith("]"):
            section = found.setdefault(line[1:-1], {})
        elif _KEYED.match(line) or _LISTED.match(line):
            section |= _keys([line])
        elif re.match(r"[A-Za-z]", line):
            rows = section.setdefault(line.replace(" ", "_"), [])
        elif isinstance(value := _value(line), list | float):
            rows += value if isinstance(value, list) else [value]
    sections = {
        name: {key: value[0] if isinstance(value, list) and len(value) == 1 else value for key, value in keys.items()}
        for name, keys in found.items()
        if keys
    }
    keys = [key for one in sections.values() for key in one]
    # Of one camera alone, its size and its matrix may stand in different sections.
    return sections if len(set(keys)) < len(keys) else {k: v for one in sections.values() for k, v in one.items()}


def _value(text: str) -> Any:
    """Parse a number, a list of numbers, or the text itself."""
    words = re.sub(r"[,;\[\](){}]", " ", text).split()
    try:
        found = [float(word) for word in words]
    except ValueError:
        return text
    return found[0] if len(found) == 1 else found
