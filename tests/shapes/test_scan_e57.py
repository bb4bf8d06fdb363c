"""E57: the valid points of every scan, each by its pose, block by block; damaged files are one sentence and stay."""

from pathlib import Path

import numpy as np
import pytest

from kpred.errors import ScanError
from kpred.shapes.formats import scan_e57
from kpred.shapes.formats.scan_e57 import e57_points
from kpred.shapes.scan import read_scan

pye57 = pytest.importorskip("pye57", reason="pye57 is not installed (the extra e57)")

QUARTER = np.array([np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)])
SHIFT = np.array([694386.0, 5155487.0, 381.0])


def _write(path: Path, clouds: list[np.ndarray], invalid: np.ndarray | None = None, posed: bool = False) -> Path:
    file = pye57.E57(str(path), mode="w")
    for cloud in clouds:
        columns = dict(zip(("cartesianX", "cartesianY", "cartesianZ"), cloud.T.copy(), strict=True))
        if invalid is not None:
            columns["cartesianInvalidState"] = invalid.astype(np.int8)
        pose = {"rotation": QUARTER, "translation": SHIFT} if posed else {}
        file.write_scan_raw(columns, **pose)
    file.close()
    return path


@pytest.fixture
def points(rng: np.random.Generator) -> np.ndarray:
    return rng.random((300, 3))


def test_points_of_all_scans_are_read_without_invalid_ones(points: np.ndarray, tmp_path: Path) -> None:
    invalid = np.arange(150) % 5 == 0
    file = _write(tmp_path / "a.e57", [points[:150], points[150:]], invalid)
    np.testing.assert_allclose(read_scan(file), points[~np.tile(invalid, 2)], atol=1e-12)


def test_a_scan_lies_where_its_pose_puts_it(points: np.ndarray, tmp_path: Path) -> None:
    found = read_scan(_write(tmp_path / "a.e57", [points], posed=True))
    turned = np.stack([-points[:, 1], points[:, 0], points[:, 2]], axis=1)
    np.testing.assert_allclose(found, turned + SHIFT, atol=1e-8)


def test_blocks_are_small(points: np.ndarray, tmp_path: Path) -> None:
    blocks = list(e57_points(_write(tmp_path / "a.e57", [points]), rows=70))
    assert max(len(block) for block in blocks) == 70
    np.testing.assert_allclose(np.concatenate(blocks), points, atol=1e-12)


def test_ranges_and_angles_become_places() -> None:
    found = scan_e57._cartesian(np.array([[2.0, 0.0, 0.0], [2.0, np.pi / 2, 0.0], [2.0, 0.3, np.pi / 2]]))
    np.testing.assert_allclose(found, [[2, 0, 0], [0, 2, 0], [0, 0, 2]], atol=1e-12)


@pytest.mark.parametrize("length", [0, 20, 600, -300])
def test_what_is_cut_short_is_one_sentence_and_is_not_deleted(points: np.ndarray, tmp_path: Path, length: int) -> None:
    file = _write(tmp_path / "a.e57", [points])
    file.write_bytes(file.read_bytes()[:length])
    with pytest.raises(ScanError) as failure:
        read_scan(file)
    assert "a.e57" in str(failure.value) and "\n" not in str(failure.value)
    assert file.is_file()


def test_damage_anywhere_is_no_crash(points: np.ndarray, tmp_path: Path, rng: np.random.Generator) -> None:
    file = _write(tmp_path / "a.e57", [points])
    whole = np.frombuffer(file.read_bytes(), np.uint8)
    for _ in range(40):
        damaged = whole.copy()
        damaged[rng.integers(len(whole), size=3)] = rng.integers(256, size=3)
        file.write_bytes(damaged.tobytes())
        try:
            read_scan(file)
        except ScanError as error:
            assert "\n" not in str(error)
