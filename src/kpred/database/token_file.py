"""The file of a token table: written once beside the database, mapped into memory by every process that searches.

Layout: a page with magic, checksum and JSON header; then the arrays, each at the start of a page, whose checksums
stand in the header. The file is a cache: it is made from the database when it is missing, damaged or does not belong to
it, and may be deleted at any time.
"""

from __future__ import annotations

import errno
import json
import math
import mmap
import os
import time
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from kpred.atomic import atomic_path
from kpred.database.token_codes import CodeLayout, Quantiser
from kpred.database.token_table import TableKey, TokenTable
from kpred.errors import OutputError

_MAGIC = b"KPRDTOK2"
_HEADER = 8192
_PAGE = 4096
_CHECKED_BYTES = 1 << 30
"""Of the half-precision tokens more are not checked at opening: of a larger table a search reads few of them."""

_ABANDONED = 3600.0
"""Seconds after which the unfinished file of another process is taken as left by one that was killed."""

Rows = Iterator[tuple[list[str], np.ndarray]]
"""Ids and tokens (n, K, C) float16, part by part."""


class _Section(NamedTuple):
    """Where one array lies."""

    offset: int
    dtype: str
    shape: tuple[int, ...]

    @property
    def end(self) -> int:
        """The first page after it."""
        return self.offset + -(-math.prod(self.shape) * np.dtype(self.dtype).itemsize // _PAGE) * _PAGE

    def of(self, data: mmap.mmap) -> np.ndarray:
        """Return the array in mapped memory."""
        count = math.prod(self.shape)
        return np.frombuffer(data, self.dtype, count, self.offset).reshape(self.shape)


def open_table(path: Path) -> TokenTable | None:
    """Open the table in a file, or return None when it is missing, damaged or of another version."""
    try:
        with open(path, "rb") as file:
            start = file.read(_HEADER)
            if start[: len(_MAGIC)] != _MAGIC:
                return None
            body = start[len(_MAGIC) + 4 :].split(b"\0", 1)[0]
            if zlib.crc32(body) != int.from_bytes(start[len(_MAGIC) : len(_MAGIC) + 4], "little"):
                return None
            header = json.loads(body)
            sections = {
                name: _Section(at, dtype, tuple(shape)) for name, (at, dtype, shape) in header["arrays"].items()
            }
            if os.fstat(file.fileno()).st_size != max(section.end for section in sections.values()):
                return None
            data = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        if not all(_is_whole(section.of(data), header["checksums"][name], name) for name, section in sections.items()):
            return None
        half = sections["half"]
        # Of the half-precision tokens single models are read; reading ahead would only fill the memory.
        place = (half.offset, half.end - half.offset)
        data.madvise(mmap.MADV_RANDOM, *place)
        fields = {name: section.of(data) for name, section in sections.items()}
        quantiser = Quantiser(fields.pop("lowest"), fields.pop("step"))
        release = partial(data.madvise, mmap.MADV_DONTNEED, *place)
        return TokenTable(TableKey(**header["key"]), quantiser, **fields, release=release)
    except (OSError, ValueError, KeyError, TypeError):
        return None


def make_table(
    path: Path | None,
    key: TableKey,
    shape: tuple[int, int, int],
    rows: Rows,
    progress: Callable[[int], None] | None = None,
) -> TokenTable:
    """Write the table of M models with tokens (K, C) to a file atomically, or to memory without `path`.

    Args:
        shape: (M, K, C), of `rows` together.
        progress: called with the models that are done, each of them twice.

    Raises:
        OutputError: the file cannot be written there; the disk is full.
    """
    if path is None:
        sections = _sections(shape)
        data = mmap.mmap(-1, max(section.end for section in sections.values()))
        return TokenTable(key, *_fill(data, sections, shape, rows, progress))
    _remove_abandoned(path)
    with atomic_path(path) as temporary, open(temporary, "w+b") as file:
        sections = _sections(shape)
        size = max(section.end for section in sections.values())
        os.posix_fallocate(file.fileno(), 0, size)  # a full disk fails here, not by a signal when memory is written
        with _mapped(file.fileno(), size) as data:
            table = _fill(data, sections, shape, rows, progress)
            for name, array in _ids(table).items():
                sections[name] = _Section(size, array.dtype.str, array.shape)
                size = sections[name].end
                file.seek(sections[name].offset)
                file.write(array.tobytes())
            file.truncate(size)
            arrays = {name: section.of(data) for name, section in sections.items() if section.end <= len(data)}
            checksums = {name: zlib.crc32(array.data) for name, array in (arrays | _ids(table)).items()}
            header = {
                "key": asdict(key),
                "arrays": {name: tuple(section) for name, section in sections.items()},
                "checksums": checksums,
            }
            body = json.dumps(header).encode()
            text = _MAGIC + zlib.crc32(body).to_bytes(4, "little") + body
            if len(text) >= _HEADER:
                raise OSError(errno.ENAMETOOLONG, "the category's name is too long")
            file.seek(0)
            file.write(text)
            del table, arrays
    made = open_table(path)
    if made is None:
        raise OutputError(f"Cannot read {path} after writing it; check the disk.")
    return made


def _ids(table: _Filled) -> dict[str, np.ndarray]:
    """Read the arrays of ids, whose size depends on the models."""
    return {"id_bytes": table[-2], "id_ends": table[-1]}


def _is_whole(array: np.ndarray, checksum: int, name: str) -> bool:
    return (name == "half" and array.nbytes > _CHECKED_BYTES) or zlib.crc32(array.data) == checksum


@contextmanager
def _mapped(descriptor: int, size: int) -> Iterator[mmap.mmap]:
    data = mmap.mmap(descriptor, size)
    try:
        yield data
    finally:
        data.flush()  # arrays may still point into it, so it is closed with the last of them


def _sections(shape: tuple[int, int, int]) -> dict[str, _Section]:
    models, keypoints, size = shape
    layout = CodeLayout(keypoints, size)
    kinds: dict[str, tuple[str, tuple[int, ...]]] = {
        "lowest": ("<f8", (keypoints, size)),
        "step": ("<f8", (keypoints,)),
        "errors": ("|u1", (layout.planes, models, layout.group)),
        "codes": ("|u1", (layout.planes, models, layout.group, layout.size)),
        "half": ("<f2", shape),
    }
    sections: dict[str, _Section] = {}
    at = _HEADER
    for name, (dtype, dimensions) in kinds.items():
        sections[name] = _Section(at, dtype, dimensions)
        at = sections[name].end
    return sections


_Filled = tuple[Quantiser, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]


def _fill(
    data: mmap.mmap,
    sections: dict[str, _Section],
    shape: tuple[int, int, int],
    rows: Rows,
    progress: Callable[[int], None] | None,
) -> _Filled:
    """Write the arrays and return the table's fields after `key`; two passes, for the range must be known first."""
    models, keypoints, size = shape
    layout = CodeLayout(keypoints, size)
    half, codes, errors = (sections[name].of(data) for name in ("half", "codes", "errors"))
    lowest, highest = np.full((keypoints, size), np.inf), np.full((keypoints, size), -np.inf)
    ids: list[bytes] = []
    done, parts = 0, []
    for names, tokens in rows:
        half[done : done + len(tokens)] = tokens
        lowest, highest = np.minimum(lowest, tokens.min(axis=0)), np.maximum(highest, tokens.max(axis=0))
        ids += [name.encode("utf-8") for name in names]
        parts.append((done, done + len(tokens)))
        done += len(tokens)
        if progress is not None:
            progress(done)
    if done != models:
        raise ValueError(f"{done} models instead of {models}")
    quantiser = Quantiser.of_range(lowest, highest)
    sections["lowest"].of(data)[:], sections["step"].of(data)[:] = quantiser.lowest, quantiser.step
    for start, end in parts:
        new_codes, new_errors = quantiser.encode(half[start:end].astype(np.float32))
        padded = np.pad(new_codes, [(0, 0), (0, 0), (0, layout.size - size)])
        codes[:, start:end], errors[:, start:end] = layout.planar(padded), layout.planar(new_errors)
        if progress is not None:
            progress(models + end)
    ends = np.cumsum([len(name) for name in ids], dtype="<i8")
    return quantiser, half, codes, errors, np.frombuffer(b"".join(ids), np.uint8), ends


def _remove_abandoned(path: Path) -> None:
    """Remove unfinished files beside `path` that are old."""
    for file in path.parent.glob(f".{path.stem[:64]}.*{path.suffix}"):
        try:
            if time.time() - file.stat().st_mtime > _ABANDONED:
                file.unlink()
        except OSError:
            continue
