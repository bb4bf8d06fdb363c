"""Points that no surface returned are left out before the up axis is found and before the scan is thinned."""

from pathlib import Path

import numpy as np
import pytest
import torch

import kpred
from kpred.ops.rotations import upright_rotation
from kpred.ops.sampling import sample_surface
from kpred.preprocessing.clean import clean_scan
from kpred.preprocessing.invalid_points import invalid_points
from kpred.shapes.scan import check_points, read_scan
from kpred.synthetic.generator import generate


@pytest.fixture(scope="module")
def chair() -> np.ndarray:
    """4000 points of a chair, z up, a metre from the origin."""
    mesh = generate("chair", 1, 5)[0]
    vertices, faces = torch.tensor(mesh.vertices).double(), torch.tensor(mesh.faces).long()
    points = sample_surface(vertices, faces, 4000, torch.Generator().manual_seed(0))[0].numpy()
    return points @ upright_rotation("z") + [1.0, 0.5, 0.2]


def zeros(points: np.ndarray, fraction: float) -> np.ndarray:
    return np.concatenate([points, np.zeros((int(len(points) * fraction / (1 - fraction)), 3))])


def strays(points: np.ndarray, fraction: float, rng: np.random.Generator) -> np.ndarray:
    middle, size = points.mean(axis=0), float(np.ptp(points, axis=0).max())
    count = int(fraction / (1 - fraction) * len(points))
    return np.concatenate([points, middle + rng.uniform(-1.4, 1.4, (count, 3)) * size])


@pytest.mark.parametrize("fraction", [0.3, 0.5, 0.9, 0.95])
def test_zeros_are_left_out(chair: np.ndarray, fraction: float) -> None:
    found = invalid_points(zeros(chair, fraction))
    assert not found[: len(chair)].any()
    assert found[len(chair) :].all()


@pytest.mark.parametrize("place", [[1e6, 0.0, 0.0], [40.0, -40.0, 3.0]])
@pytest.mark.parametrize("count", [1, 150])
def test_far_points_are_left_out(chair: np.ndarray, place: list[float], count: int, rng: np.random.Generator) -> None:
    far = np.array(place) * rng.uniform(1, 2, (count, 1))
    found = invalid_points(np.concatenate([chair, far]))
    assert not found[: len(chair)].any()
    assert found[len(chair) :].all()
    assert len(check_points(np.concatenate([chair, far]))) == len(chair) + count


def test_of_repeats_the_first_stays(chair: np.ndarray, rng: np.random.Generator) -> None:
    repeated = np.concatenate([chair, chair[rng.integers(0, len(chair), 6000)]])
    found = invalid_points(repeated)
    assert not found[: len(chair)].any()
    assert found[len(chair) :].all()


def test_clean_scans_lose_nothing(shared_data: Path, chair: np.ndarray) -> None:
    assert not invalid_points(chair).any()
    for path in sorted((shared_data / "real" / "s3dis").glob("*.ply"))[::4]:
        assert not invalid_points(read_scan(path)).any(), path.name


def test_too_few_are_never_left(rng: np.random.Generator) -> None:
    points = np.concatenate([np.zeros((1000, 3)), rng.random((70, 3))])
    assert np.count_nonzero(~invalid_points(points)) >= 64
    few = np.repeat(rng.random((40, 3)), 10, axis=0)
    assert np.count_nonzero(~invalid_points(few)) >= 64


@pytest.mark.parametrize("fraction", [0.1, 0.15])
def test_strays_that_are_one_anothers_neighbours_go(
    chair: np.ndarray, fraction: float, rng: np.random.Generator
) -> None:
    result = clean_scan(strays(chair, fraction, rng), up="z")
    assert result.object_points[: len(chair)].mean() > 0.99
    assert result.object_points[len(chair) :].mean() < 0.1


@pytest.mark.parametrize("damage", ["zeros", "far", "repeats", "strays"])
def test_the_up_axis_and_the_box_are_those_of_the_object(
    chair: np.ndarray, damage: str, rng: np.random.Generator
) -> None:
    scan = {
        "zeros": lambda: zeros(chair, 0.7),
        "far": lambda: np.concatenate([chair, [[1e6, 2e5, -3e5]]]),
        "repeats": lambda: np.concatenate([chair, np.repeat(chair[:200], 100, axis=0)]),
        "strays": lambda: strays(chair, 0.1, rng),
    }[damage]()
    alone, found = kpred.fit(chair), kpred.fit(scan)
    assert found.frame.rotation[1, 2] > 0.99 and alone.frame.rotation[1, 2] > 0.99
    np.testing.assert_allclose(found.mesh.bounds, alone.mesh.bounds, atol=0.05)
    assert found.confidence > 0.5 or alone.confidence < 0.5
