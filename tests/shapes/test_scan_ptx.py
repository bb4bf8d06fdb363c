"""PTX: several scans in one frame, each with the transform of its scanner."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kpred.errors import ScanError
from kpred.shapes.scan import read_scan


def one_scan(points: np.ndarray, matrix: np.ndarray, columns: int = 10, tail: str = " 0.5 10 20 30") -> str:
    """Points of the shared frame as one scanner wrote them; every tenth direction shows nothing."""
    local = np.concatenate([points, np.ones((len(points), 1))], axis=1) @ np.linalg.inv(matrix)
    seen = [f"{x!r} {y!r} {z!r}{tail}" for x, y, z, _ in local.tolist()]
    rays = [line for start in range(0, len(seen), 9) for line in [*seen[start : start + 9], f"0 0 0{tail}"]]
    head = [str(columns), str(len(rays) // columns), "0 0 0", "1 0 0", "0 1 0", "0 0 1"]
    head += [" ".join(map(repr, row)) for row in matrix.tolist()]
    return "\n".join([*head, *rays]) + "\n"


@pytest.fixture
def text(rng: np.random.Generator) -> tuple[np.ndarray, str]:
    points = rng.random((180, 3))
    matrix = np.eye(4)
    # Rows times the matrix: the translation stands in the last row.
    matrix[:3, :3], matrix[3, :3] = Rotation.from_euler("z", 40, degrees=True).as_matrix(), [2, -1, 0.5]
    return points, one_scan(points[:90], matrix) + one_scan(points[90:], np.eye(4), tail=" 0.25")


@pytest.mark.parametrize("ending", ["\n", "\r\n"])
def test_scans_are_put_into_one_frame_and_empty_directions_left_out(
    text: tuple[np.ndarray, str], tmp_path: Path, ending: str
) -> None:
    (tmp_path / "a.ptx").write_bytes(text[1].replace("\n", ending).encode())
    np.testing.assert_allclose(read_scan(tmp_path / "a.ptx"), text[0], atol=1e-12)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda lines: lines[:50], "cut short"),
        (lambda lines: ["99999", "99999", *lines[2:]], "cut short"),
        (lambda lines: ["a", *lines[1:]], "header is damaged"),
        (lambda lines: [*lines[:6], "1 0 0", *lines[7:]], "header is damaged"),
        (lambda lines: [*lines[:6], "nan 0 0 0", *lines[7:]], "header is damaged"),
        (lambda lines: [*lines[:20], "1 2", *lines[21:]], "line 21 does not hold"),
    ],
)
def test_damage_is_named(text: tuple[np.ndarray, str], tmp_path: Path, change, words: str) -> None:
    (tmp_path / "a.ptx").write_text("\n".join(change(text[1].splitlines())))
    with pytest.raises(ScanError, match=words):
        read_scan(tmp_path / "a.ptx")
