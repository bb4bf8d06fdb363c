"""Cleaning: the object stays, strays and pieces of the room go, whatever the unit, the yaw and the density."""

from pathlib import Path

import numpy as np
import pytest
import torch
import trimesh
from scipy.spatial import cKDTree

from kpred.errors import ConfigError, ScanError
from kpred.ops.occlusion import depth_scan
from kpred.ops.rotations import upright_rotation, yaw_rotation
from kpred.preprocessing.clean import CleanConfig, CleanedScan, clean_scan
from kpred.preprocessing.downsample import poisson_disc
from kpred.preprocessing.outliers import duplicate_points
from kpred.shapes.mesh import Mesh
from kpred.shapes.scan import read_scan
from kpred.synthetic.generator import generate

CATEGORIES = ("chair", "table", "cabinet")
NO_THINNING = CleanConfig(density=False)


def seen(vertices: np.ndarray, faces: np.ndarray, seed: int, count: int = 4000) -> np.ndarray:
    """Depth scan from the front half, above."""
    rng = np.random.default_rng(seed)
    size = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    yaw, rise = rng.uniform(-1.2, 1.2), rng.uniform(0.25, 0.8)
    camera = 2.2 * size * np.array([np.sin(yaw) * np.cos(rise), np.sin(rise), np.cos(yaw) * np.cos(rise)])
    return (
        depth_scan(
            torch.tensor(vertices).float(),
            torch.tensor(faces).long(),
            torch.tensor(camera).float(),
            count,
            noise=0.004,
            generator=torch.Generator().manual_seed(seed),
        )
        .double()
        .numpy()
    )


def with_quad(mesh: Mesh, center: np.ndarray, u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    corners = np.stack([center - u - v, center + u - v, center + u + v, center - u + v])
    faces = np.array([[0, 1, 2], [0, 2, 3]]) + len(mesh.vertices)
    return np.concatenate([mesh.vertices, corners]), np.concatenate([mesh.faces, faces])


def with_floor(mesh: Mesh, margin: float = 0.25) -> tuple[np.ndarray, np.ndarray]:
    low, high = mesh.bounds.astype(float)
    half, size = (high - low) / 2, float(np.linalg.norm(high - low))
    center = np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
    return with_quad(mesh, center, np.array([half[0] + margin * size, 0, 0]), np.array([0, 0, half[2] + margin * size]))


def with_wall(mesh: Mesh, gap: float = 0.06, margin: float = 0.25) -> tuple[np.ndarray, np.ndarray]:
    low, high = mesh.bounds.astype(float)
    half, size = (high - low) / 2, float(np.linalg.norm(high - low))
    rise = half[1] + margin * size / 2
    center = np.array([(low[0] + high[0]) / 2, low[1] + rise, low[2] - gap * size])
    return with_quad(mesh, center, np.array([half[0] + margin * size, 0, 0]), np.array([0, rise, 0]))


def distance_to_mesh(points: np.ndarray, mesh: Mesh) -> np.ndarray:
    """Relative to the diagonal of its box."""
    from kpred.ops.sampling import sample_surface

    dense, _ = sample_surface(
        torch.tensor(mesh.vertices), torch.tensor(mesh.faces).long(), 30_000, torch.Generator().manual_seed(0)
    )
    distance: np.ndarray = cKDTree(dense.numpy()).query(points)[0]
    return distance / float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))


def step(scan: CleanedScan, name: str) -> int:
    return sum(entry.removed for entry in scan.steps if entry.name == name)


@pytest.fixture(scope="module")
def furniture() -> dict[str, list[Mesh]]:
    packs = {name: generate(name, 6, 5) for name in CATEGORIES}
    return {name: [pack[row] for row in range(len(pack))] for name, pack in packs.items()}


@pytest.fixture(scope="module")
def chair_scan() -> np.ndarray:
    mesh = generate("chair", 1, 5)[0]
    return seen(mesh.vertices, mesh.faces, 0)


@pytest.mark.parametrize("category", CATEGORIES)
def test_strays_go_and_the_object_stays(furniture: dict[str, list[Mesh]], category: str) -> None:
    survived = []
    for seed, mesh in enumerate(furniture[category]):
        scan = seen(mesh.vertices, mesh.faces, seed)
        rng = np.random.default_rng(seed)
        low, high = mesh.bounds
        strays = low + (high - low) * (rng.random((80, 3)) * 1.2 - 0.1)
        size = float(np.linalg.norm(high - low))
        far = cKDTree(scan).query(strays)[0] > 0.08 * size  # nearer ones are no worse than noise
        result = clean_scan(np.concatenate([scan, strays]), config=NO_THINNING)
        kept, stray_kept = result.kept[: len(scan)], result.kept[len(scan) :]
        assert kept.mean() >= 0.98, mesh.name
        survived.append(stray_kept[far])
    assert np.concatenate(survived).mean() <= 0.05


@pytest.mark.parametrize("category", CATEGORIES)
def test_a_piece_of_floor_goes_and_feet_stay(furniture: dict[str, list[Mesh]], category: str) -> None:
    kept, removed = [], []
    for seed, mesh in enumerate(furniture[category]):
        if float(mesh.bounds[0, 1]) > 0.01:
            continue
        scan = seen(*with_floor(mesh), seed)
        distance = distance_to_mesh(scan, mesh)
        result = clean_scan(scan, config=NO_THINNING)
        kept.append(result.kept[distance < 0.015].mean())
        removed.append(1 - result.kept[distance > 0.03].mean())
        assert result.floor_height == pytest.approx(float(mesh.bounds[0, 1]), abs=0.02), mesh.name
    assert np.median(removed) >= 0.95
    assert np.mean(removed) >= 0.9
    assert np.mean(kept) >= 0.97


@pytest.mark.parametrize("category", CATEGORIES)
def test_a_piece_of_wall_goes_and_backs_stay(furniture: dict[str, list[Mesh]], category: str) -> None:
    kept, removed = [], []
    for seed, mesh in enumerate(furniture[category]):
        scan = seen(*with_wall(mesh), seed)
        distance = distance_to_mesh(scan, mesh)
        result = clean_scan(scan, config=NO_THINNING)
        kept.append(result.kept[distance < 0.015].mean())
        removed.append(1 - result.kept[distance > 0.03].mean())
    assert np.median(removed) >= 0.95
    assert np.mean(removed) >= 0.9
    assert np.mean(kept) >= 0.97


@pytest.mark.parametrize("category", CATEGORIES)
def test_an_object_without_a_room_loses_neither_floor_nor_wall(category: str) -> None:
    pack = generate(category, 12, 9)
    for row in range(len(pack)):
        mesh = pack[row]
        result = clean_scan(seen(mesh.vertices, mesh.faces, row, 3000), config=NO_THINNING)
        assert step(result, "floor") == 0, mesh.name
        assert step(result, "wall") == 0, mesh.name
        assert result.floor_height is None
        assert result.kept.mean() > 0.98, mesh.name


def test_unit_and_place_change_nothing(chair_scan: np.ndarray) -> None:
    one = clean_scan(chair_scan)
    other = clean_scan(chair_scan * 1024.0 + np.array([4096.0, -2048.0, 512.0]))
    assert (one.kept == other.kept).mean() > 0.999
    assert [entry.name for entry in one.steps] == [entry.name for entry in other.steps]


@pytest.mark.parametrize("angle", [0.4, 2.0])
def test_yaw_changes_next_to_nothing(furniture: dict[str, list[Mesh]], angle: float) -> None:
    scan = seen(*with_floor(furniture["chair"][0]), 1)
    one = clean_scan(scan, config=NO_THINNING)
    turned = clean_scan(scan @ yaw_rotation(angle).T, config=NO_THINNING)
    assert (one.kept == turned.kept).mean() > 0.99


def test_up_axis_is_respected(furniture: dict[str, list[Mesh]]) -> None:
    scan = seen(*with_floor(furniture["table"][0]), 1)
    one = clean_scan(scan, config=NO_THINNING)
    z_up = clean_scan(scan @ upright_rotation("z"), up="z", config=NO_THINNING)
    assert step(one, "floor") > 100
    assert (one.kept == z_up.kept).mean() > 0.99
    assert one.floor_height is not None
    assert z_up.floor_height == pytest.approx(one.floor_height, abs=0.01)


def test_duplicates_are_the_repeats_and_not_the_firsts(rng: np.random.Generator) -> None:
    points = rng.random((500, 3))
    points[7] = [0.0, -0.0, 0.0]
    order = rng.integers(0, 500, 2000)
    repeated = np.concatenate([points, points[order] * [1.0, 1.0, 1.0]])
    repeated[500] = [-0.0, 0.0, -0.0]
    expected = np.zeros(len(repeated), dtype=bool)
    expected[500:] = True
    assert (duplicate_points(repeated) == expected).all()


def test_density_becomes_even(rng: np.random.Generator) -> None:
    """A plate scanned ten times more densely on one half ends with the same number of points on both."""
    dense, sparse = rng.random((20_000, 2)) * [1, 1], rng.random((2500, 2)) * [1, 1] + [1, 0]
    flat = np.concatenate([dense, sparse])
    points = np.column_stack([flat[:, 0], 0.02 * np.sin(9 * flat[:, 1]), flat[:, 1]])
    result = clean_scan(points, config=CleanConfig(floor=False, wall=False, points=1024))
    left = (result.points[:, 0] < 1).sum()
    right = (result.points[:, 0] >= 1).sum()
    assert 1024 <= len(result.points) <= 1600
    assert 0.7 < left / right < 1.4
    gaps = cKDTree(result.points).query(result.points, k=2)[0][:, 1]
    assert gaps.min() > 0.5 * np.median(gaps)


def test_thinning_keeps_what_it_must(rng: np.random.Generator) -> None:
    clump = np.concatenate([rng.normal(size=(6000, 3)) * 1e-4, rng.random((1000, 3))])
    kept, distance = poisson_disc(clump, 512, 0)
    assert len(kept) >= 512
    assert distance >= 0
    assert len(np.unique(kept)) == len(kept)
    same, none = poisson_disc(clump[:500], 512, 0)
    assert len(same) == 500
    assert none == 0.0


def test_order_and_bookkeeping(chair_scan: np.ndarray) -> None:
    result = clean_scan(chair_scan)
    assert (result.points == chair_scan[result.kept]).all()
    assert sum(entry.removed for entry in result.steps) == (~result.kept).sum()
    assert (result.kept <= result.object_points).all()
    again = clean_scan(chair_scan)
    assert (again.kept == result.kept).all()


def test_every_step_can_be_switched_off(chair_scan: np.ndarray) -> None:
    off = CleanConfig(duplicates=False, outliers=False, floor=False, wall=False, density=False)
    result = clean_scan(chair_scan, config=off)
    assert result.kept.all()
    assert result.steps == ()


def test_normals_face_the_sensor(rng: np.random.Generator) -> None:
    sphere = rng.normal(size=(3000, 3))
    sphere /= np.linalg.norm(sphere, axis=1, keepdims=True)
    outward = clean_scan(sphere, config=CleanConfig(normals=True))
    assert outward.normals is not None
    assert (outward.normals * outward.points).sum(axis=1).min() > 0.9
    sensor = np.array([0.0, 0.0, 5.0])
    facing = clean_scan(sphere, config=CleanConfig(normals=True), sensor=sensor)
    assert facing.normals is not None
    assert (facing.normals * (sensor - facing.points)).sum(axis=1).min() >= 0


@pytest.mark.parametrize("count", [0, 1, 10, 64, 70])
def test_tiny_clouds_come_through(rng: np.random.Generator, count: int) -> None:
    points = rng.random((count, 3))
    result = clean_scan(points, config=CleanConfig(normals=True))
    assert len(result.points) >= min(count, 64)
    assert result.normals is not None
    assert result.normals.shape == result.points.shape


def test_it_backs_off_before_too_little_is_left(rng: np.random.Generator) -> None:
    points = np.repeat(rng.random((40, 3)), 10, axis=0)
    result = clean_scan(points)
    assert result.kept.sum() >= 64
    assert any("backed off" in entry.detail for entry in result.steps)


def test_a_sphere_and_a_floor_alone_stay(rng: np.random.Generator) -> None:
    sphere = rng.normal(size=(3000, 3))
    sphere /= np.linalg.norm(sphere, axis=1, keepdims=True)
    floor = np.column_stack([rng.random(3000), rng.normal(size=3000) * 0.002, rng.random(3000)])
    for points in (sphere, floor):
        assert clean_scan(points, config=NO_THINNING).kept.mean() > 0.98


def test_impossible_arguments() -> None:
    points = np.random.default_rng(0).random((100, 3))
    with pytest.raises(ConfigError, match="up axis"):
        clean_scan(points, up="w")
    with pytest.raises(ConfigError, match="wall_beyond"):
        CleanConfig(wall_beyond=0.0)
    points[3, 1] = np.nan
    with pytest.raises(ScanError, match="NaN"):
        clean_scan(points)


def test_real_crops_keep_their_object(shared_data: Path) -> None:
    """Single objects cut out by labels: next to nothing of the room is in them."""
    crops = sorted((shared_data / "real" / "s3dis").glob("*.ply"))[::3]
    for path in crops:
        points = read_scan(path)
        result = clean_scan(points)
        assert result.object_points.mean() > 0.93, (path.name, result.steps)
        assert len(result.points) >= 2048


@pytest.mark.parametrize("count", [4000, 40_000])
@pytest.mark.parametrize("fraction", [0.05, 0.11, 0.2, 0.3])
@pytest.mark.parametrize("category", ["chair", "cabinet"])
def test_many_strays_are_left_out_of_sparse_and_dense_scans(count: int, fraction: float, category: str) -> None:
    rng = np.random.default_rng(3)
    mesh = generate(category, 1, seed=9)[0]
    chair = trimesh.sample.sample_surface(trimesh.Trimesh(mesh.vertices, mesh.faces, process=False), count, seed=2)[0]
    low, high = chair.min(axis=0), chair.max(axis=0)
    strays = rng.uniform(2 * low - high, 2 * high - low, size=(int(fraction * count), 3))
    found = clean_scan(np.concatenate([chair, strays]), "y").object_points
    # Within the box, and just outside, some lie as near to the surface as its own points do.
    margin = 0.1 * np.linalg.norm(high - low)
    outside = ((strays < low - margin) | (strays > high + margin)).any(axis=1)
    assert found[:count].mean() > 0.995
    assert found[count:][outside].mean() < 0.005
