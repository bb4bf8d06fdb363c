"""A floor inside of a tight box goes, with and without its height known; boards and bottoms of furniture stay."""

import numpy as np
import pytest
import torch

import kpred
from kpred.ops.sampling import sample_surface
from kpred.preprocessing.clean import CleanConfig, CleanedScan, clean_scan
from kpred.shapes.mesh import Mesh
from kpred.synthetic.generator import generate

NO_THINNING = CleanConfig(density=False)
POINTS = 4000


def surface(mesh: Mesh, seed: int) -> np.ndarray:
    vertices, faces = torch.tensor(mesh.vertices).double(), torch.tensor(mesh.faces).long()
    return sample_surface(vertices, faces, POINTS, torch.Generator().manual_seed(seed))[0].numpy()


def floor_of_box(mesh: Mesh, seed: int, margin: float = 0.01) -> np.ndarray:
    """Half as many points again, on the floor of a box that is 1 % of the object's diagonal wider than it."""
    rng = np.random.default_rng(seed)
    low, high = mesh.bounds.astype(float)
    diagonal = float(np.linalg.norm(high - low))
    floor = rng.uniform(low - margin * diagonal, high + margin * diagonal, (POINTS // 2, 3))
    floor[:, 1] = low[1] + 0.002 * diagonal * rng.standard_normal(len(floor))
    return floor


def removed(result: CleanedScan) -> int:
    return sum(step.removed for step in result.steps if step.name == "floor")


@pytest.mark.parametrize("told", [False, True])
@pytest.mark.parametrize("category", ["chair", "table"])
def test_the_floor_of_a_tight_box_goes_and_feet_stay(category: str, told: bool) -> None:
    left, kept = [], []
    for seed, mesh in enumerate(list(generate(category, 12, 21))):
        low = float(mesh.bounds[0, 1])
        scan = np.concatenate([surface(mesh, seed), floor_of_box(mesh, seed)])
        result = clean_scan(scan, config=NO_THINNING, floor=low if told else None)
        left.append(result.kept[POINTS:].mean())
        kept.append(result.kept[:POINTS].mean())
        if removed(result):
            assert result.floor_height == pytest.approx(low, abs=0.01)
    assert np.median(left) < 0.1
    assert np.mean(np.array(left) < 0.3) >= 0.75
    assert min(kept) > 0.9 and np.mean(kept) > 0.97


@pytest.mark.parametrize("told", [False, True])
@pytest.mark.parametrize("category", ["chair", "table", "cabinet"])
def test_furniture_keeps_its_own_boards(category: str, told: bool) -> None:
    for seed, mesh in enumerate(list(generate(category, 12, 22))):
        result = clean_scan(surface(mesh, seed), config=NO_THINNING, floor=float(mesh.bounds[0, 1]) if told else None)
        assert removed(result) == 0, mesh.name


@pytest.mark.parametrize("told", [False, True])
def test_a_closed_body_keeps_its_bottom(told: bool, rng: np.random.Generator) -> None:
    box = rng.uniform(-1, 1, (POINTS, 3))
    side = rng.integers(0, 3, POINTS)
    box[np.arange(POINTS), side] = np.sign(box[np.arange(POINTS), side])
    assert removed(clean_scan(box, config=NO_THINNING, floor=-1.0 if told else None)) == 0


def test_a_plane_above_the_known_floor_is_no_floor(rng: np.random.Generator) -> None:
    top = rng.uniform([-0.5, 0.70, -0.4], [0.5, 0.74, 0.4], (2000, 3))
    corners = rng.choice([-1.0, 1.0], (1000, 2)) * [0.47, 0.37]
    legs = np.column_stack([corners[:, 0], rng.uniform(0.0, 0.7, 1000), corners[:, 1]])
    legs[:, [0, 2]] += rng.uniform(-0.03, 0.03, (1000, 2))
    plane = rng.uniform([-0.5, -0.001, -0.4], [0.5, 0.001, 0.4], (2000, 3))
    scan = np.concatenate([top, legs, plane])
    assert removed(clean_scan(scan, config=NO_THINNING, floor=0.0)) > 1500
    assert removed(clean_scan(scan, config=NO_THINNING, floor=-0.2)) == 0


def test_a_wide_top_above_the_known_floor_is_no_floor(rng: np.random.Generator) -> None:
    top = rng.uniform([-1.0, 0.748, -0.5], [1.0, 0.752, 0.5], (3000, 3))
    thing = rng.uniform([-0.2, 0.75, -0.2], [0.2, 1.25, 0.2], (2000, 3))
    scan = np.concatenate([top, thing])
    assert removed(clean_scan(scan, config=NO_THINNING, floor=0.75)) > 2000
    assert removed(clean_scan(scan, config=NO_THINNING, floor=0.0)) == 0


@pytest.mark.parametrize("floor", [None, 0.0])
def test_a_table_with_the_floor_in_its_box_is_no_block(floor: float | None) -> None:
    errors = []
    for seed, mesh in enumerate(list(generate("table", 4, 23))):
        scan = np.concatenate([surface(mesh, seed), floor_of_box(mesh, seed)])
        found = kpred.fit(scan - [0.0, float(mesh.bounds[0, 1]), 0.0], up="y", floor=floor)
        alone = kpred.fit(surface(mesh, seed) - [0.0, float(mesh.bounds[0, 1]), 0.0], up="y", floor=floor)
        errors.append((found.mesh.area, alone.mesh.area, found.category))
    # A block has sides.
    assert sum(category == "table" for _, _, category in errors) >= 3
    assert np.median([abs(np.log(with_floor / without)) for with_floor, without, _ in errors]) < 0.25
