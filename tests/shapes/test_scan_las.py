"""LAS: whole numbers with scale and offset, noise and withheld points left out; compressed files are refused."""

import struct
from pathlib import Path

import numpy as np
import pytest

from kpred.errors import ScanError
from kpred.shapes.scan import read_scan

SCALE, OFFSET = 0.001, np.array([694386.0, 5155487.0, 381.0])


def las(points: np.ndarray, version: int = 2, kind: int = 3, classes: np.ndarray | None = None) -> bytes:
    """A LAS file 1.`version` of points in steps of a millimetre; `classes` (N,) with 128 for withheld."""
    width = {0: 20, 3: 34, 7: 36}[kind & 63]
    records = np.zeros((len(points), width), np.uint8)
    records[:, :12] = ((points - OFFSET) / SCALE).round().astype("<i4").view(np.uint8)
    given = np.zeros(len(points), np.uint8) if classes is None else classes.astype(np.uint8)
    if kind & 63 <= 5:
        records[:, 15] = given
    else:
        records[:, 16], records[:, 15] = given & 31, np.where(given & 128, 4, 0)
    size = 375 if version == 4 else 227
    header = bytearray(size + 54)  # A record of variable length stands between header and points.
    header[:4], header[24], header[25] = b"LASF", 1, version
    struct.pack_into("<HIIBHI", header, 94, size, len(header), 1, kind, width, 0 if version == 4 else len(points))
    struct.pack_into("<6d", header, 131, *[SCALE] * 3, *OFFSET)
    if version == 4:
        struct.pack_into("<Q", header, 247, len(points))
    return bytes(header) + records.tobytes()


@pytest.fixture
def points(rng: np.random.Generator) -> np.ndarray:
    return rng.random((200, 3)).round(3) + OFFSET


@pytest.mark.parametrize(("version", "kind"), [(0, 0), (2, 3), (4, 7)])
def test_points_stand_where_scale_and_offset_say(points: np.ndarray, tmp_path: Path, version: int, kind: int) -> None:
    (tmp_path / "a.las").write_bytes(las(points, version, kind))
    np.testing.assert_allclose(read_scan(tmp_path / "a.las"), points, atol=1e-6)


@pytest.mark.parametrize(("version", "kind"), [(2, 3), (4, 7)])
def test_noise_and_withheld_points_are_left_out(points: np.ndarray, tmp_path: Path, version: int, kind: int) -> None:
    classes = np.array([2, 7, 18, 128, 5])[np.arange(200) % 5]
    (tmp_path / "a.las").write_bytes(las(points, version, kind, classes))
    np.testing.assert_allclose(read_scan(tmp_path / "a.las"), points[np.isin(classes, [2, 5])], atol=1e-6)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda data: data[:-40], "cut short"),
        (lambda data: data[:100], "not a whole LAS file"),
        (lambda data: b"stub" * 100, "not a whole LAS file"),
        (lambda data: data[:131] + bytes(8) + data[139:], "header is damaged"),
        (lambda data: data[:104] + bytes([131]) + data[105:], r"compressed \(LAZ\)"),
        (lambda data: data[:105] + bytes([3]) + data[106:], "header is damaged"),
    ],
)
def test_damage_is_named(points: np.ndarray, tmp_path: Path, change, words: str) -> None:
    (tmp_path / "a.las").write_bytes(change(las(points)))
    with pytest.raises(ScanError, match=words):
        read_scan(tmp_path / "a.las")
