"""LAZ: the points of the LAS file that was compressed, block by block; damaged files are one sentence."""

from pathlib import Path

import numpy as np
import pytest

from kpred.errors import ScanError
from kpred.shapes.formats.scan_laz import laz_points
from kpred.shapes.scan import read_scan

laspy = pytest.importorskip("laspy", reason="laspy is not installed (the extra las)")
pytest.importorskip("lazrs", reason="lazrs is not installed (the extra las)")


def _write(path: Path, points: np.ndarray, classes: np.ndarray, kind: int) -> Path:
    header = laspy.LasHeader(point_format=kind, version="1.4")
    header.scales, header.offsets = [0.001] * 3, points.min(axis=0).round()
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = points.T
    cloud.classification = np.where(classes == 128, 2, classes)
    cloud.withheld = classes == 128
    cloud.write(path)
    return path


@pytest.fixture
def points(rng: np.random.Generator) -> np.ndarray:
    return rng.random((300, 3)).round(3) + [694386.0, 5155487.0, 381.0]


@pytest.mark.parametrize("kind", [0, 3, 6, 7])
def test_points_are_those_that_were_written_without_noise(points: np.ndarray, tmp_path: Path, kind: int) -> None:
    classes = np.array([2, 7, 18, 128, 5])[np.arange(300) % 5]
    file = _write(tmp_path / "a.laz", points, classes, kind)
    np.testing.assert_allclose(read_scan(file), points[np.isin(classes, [2, 5])], atol=1e-6)


def test_blocks_are_small(points: np.ndarray, tmp_path: Path) -> None:
    blocks = list(laz_points(_write(tmp_path / "a.laz", points, np.zeros(300, int), 6), rows=70))
    assert [len(block) for block in blocks] == [70, 70, 70, 70, 20]
    np.testing.assert_allclose(np.concatenate(blocks), points, atol=1e-6)


@pytest.mark.parametrize("length", [20, 200, 380, -300, -40])
def test_what_is_cut_short_is_one_sentence(points: np.ndarray, tmp_path: Path, length: int) -> None:
    file = _write(tmp_path / "a.laz", points, np.zeros(300, int), 6)
    file.write_bytes(file.read_bytes()[:length])
    with pytest.raises(ScanError) as failure:
        read_scan(file)
    assert "a.laz" in str(failure.value) and "\n" not in str(failure.value)


def test_damage_anywhere_is_no_crash(points: np.ndarray, tmp_path: Path, rng: np.random.Generator) -> None:
    file = _write(tmp_path / "a.laz", points, np.zeros(300, int), 6)
    whole = np.frombuffer(file.read_bytes(), np.uint8)
    for _ in range(40):
        damaged = whole.copy()
        damaged[rng.integers(len(whole), size=3)] = rng.integers(256, size=3)
        file.write_bytes(damaged.tobytes())
        try:
            read_scan(file)
        except ScanError as error:
            assert "\n" not in str(error)
