"""The floor of a scene is found where there is one, by labels or by points, and is not invented where there is none."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kpred.scenes.floor import SceneFloor, find_floor
from kpred.scenes.objects import SceneObject
from kpred.scenes.scene import Scene

AXES = {"x": [1, 0, 0], "y": [0, 1, 0], "z": [0, 0, 1], "-x": [-1, 0, 0], "-y": [0, -1, 0], "-z": [0, 0, -1]}
FLOOR, WALL, CHAIR, TABLE = 2, 1, 5, 7


def board(rng: np.random.Generator, low: list[float], high: list[float], count: int) -> np.ndarray:
    return rng.uniform(low, high, (count, 3))


def room(rng: np.random.Generator, level: float = 0.3, noise: float = 0.01) -> tuple[np.ndarray, np.ndarray]:
    """Points and NYU40 labels, z up, metres: a floor of 5 x 4 m seen unevenly, two walls, two tables with legs."""
    floor = [board(rng, [0, 0, 0], [5, 4, 0], 1500), board(rng, [0, 0, 0], [1.5, 1.5, 0], 6000)]
    walls = [board(rng, [0, 0, 0], [5, 0, 2.4], 2500), board(rng, [0, 0, 0], [0, 4, 2.4], 2500)]
    parts, labels = [*floor, *walls], [FLOOR, FLOOR, WALL, WALL]
    for x, y in ((2.0, 1.0), (3.2, 2.4)):
        parts.append(board(rng, [x, y, 0.72], [x + 1.4, y + 0.8, 0.75], 4000))
        parts += [
            board(rng, [x + a, y + b, 0], [x + a + 0.05, y + b + 0.05, 0.72], 200) for a in (0, 1.3) for b in (0, 0.7)
        ]
        labels += [TABLE] * 5
    numbers = np.repeat(labels, [len(part) for part in parts])
    points = np.concatenate(parts) + rng.normal(0, noise, (len(numbers), 3)) + [0, 0, level]
    return points, numbers


def table_object(points: np.ndarray, numbers: np.ndarray) -> SceneObject:
    rows = np.flatnonzero(numbers == TABLE)
    return SceneObject("tables", "table", points[rows], rows)


@pytest.mark.parametrize("labelled", [True, False])
def test_the_floor_is_found_to_a_centimetre(rng: np.random.Generator, labelled: bool) -> None:
    points, numbers = room(rng)
    floor = find_floor(Scene(points, numbers if labelled else None))
    assert floor is not None
    assert floor.source == ("labels" if labelled else "points")
    assert floor.height_under(points[numbers == TABLE]) == pytest.approx(0.3, abs=0.015)
    assert floor.metres == 1.0


@pytest.mark.parametrize("up", AXES)
def test_any_axis_may_be_up(rng: np.random.Generator, up: str) -> None:
    points, numbers = room(rng)
    turn = Rotation.align_vectors([AXES[up]], [[0, 0, 1]])[0]
    floor = find_floor(Scene(turn.apply(points), up=up))
    assert floor is not None
    assert floor.height_under(turn.apply(points[numbers == TABLE])) == pytest.approx(0.3, abs=0.015)


@pytest.mark.parametrize(("unit", "metres"), [(0.01, 0.01), (0.001, 0.001)])
def test_any_unit_will_do_and_is_told(rng: np.random.Generator, unit: float, metres: float) -> None:
    points, numbers = room(rng)
    floor = find_floor(Scene(points / unit))
    assert floor is not None
    assert floor.metres == metres
    assert floor.height_under(points[numbers == TABLE] / unit) * unit == pytest.approx(0.3, abs=0.015)


def test_a_leaning_floor_is_followed(rng: np.random.Generator) -> None:
    points, numbers = room(rng, level=0.0)
    points = Rotation.from_euler("y", 3, degrees=True).apply(points)
    floor = find_floor(Scene(points))
    assert floor is not None
    for rows in (points[:, 0] < 1, points[:, 0] > 4):
        lying = points[rows & (numbers == FLOOR)]
        middle = (lying[:, :2].min(axis=0) + lying[:, :2].max(axis=0)) / 2
        near = np.linalg.norm(lying[:, :2] - middle, axis=1) < 0.4
        assert floor.height_under(lying) == pytest.approx(np.median(lying[near, 2]), abs=0.02)
    assert floor.slope[0] == pytest.approx(-np.tan(np.radians(3)), abs=0.01)


def test_strays_below_the_floor_are_no_floor(rng: np.random.Generator) -> None:
    points, numbers = room(rng)
    strays = board(rng, [0, 0, -1.5], [5, 4, 0], 60)
    for labels in (None, np.concatenate([numbers, np.full(60, FLOOR)])):
        floor = find_floor(Scene(np.concatenate([points, strays]), labels))
        assert floor is not None
        assert floor.level == pytest.approx(0.3, abs=0.03)


def test_where_there_is_no_floor_none_is_found(rng: np.random.Generator) -> None:
    points, numbers = room(rng)
    without = numbers != FLOOR
    assert find_floor(Scene(points[without], numbers[without])) is None
    # The tops of the tables are level, large and, but for thin legs, the lowest there is.
    tables = numbers == TABLE
    item = table_object(points[tables], numbers[tables])
    assert find_floor(Scene(points[tables]), [item]) is None
    assert find_floor(Scene(points[tables])) is None
    assert find_floor(Scene(points[numbers == WALL])) is None
    assert find_floor(Scene(rng.normal(size=(5000, 3)))) is None


def test_a_ceiling_is_no_floor(rng: np.random.Generator) -> None:
    points, numbers = room(rng)
    assert find_floor(Scene(points[numbers != WALL], up="-z")) is None


def test_an_object_that_is_named_floor_is_the_floor(rng: np.random.Generator) -> None:
    points, numbers = room(rng)
    rows = np.flatnonzero(numbers == FLOOR)
    everything = [SceneObject("floor_1", "floor", points[rows], rows), table_object(points, numbers)]
    walls = np.flatnonzero(numbers == WALL)
    everything.append(SceneObject("wall_1", "wall", points[walls], walls))
    floor = find_floor(Scene(points), everything)
    assert floor is not None
    assert floor.source == "labels"
    assert floor.level == pytest.approx(0.3, abs=0.02)


def test_rows_that_are_not_finite_are_passed_over(rng: np.random.Generator) -> None:
    points, numbers = room(rng)
    points[::50] = np.nan
    floor = find_floor(Scene(points, numbers))
    assert floor is not None
    assert floor.level == pytest.approx(0.3, abs=0.02)


def test_few_labelled_points_are_not_trusted(rng: np.random.Generator) -> None:
    points, numbers = room(rng)
    lonely = np.where((numbers == FLOOR) & (np.cumsum(numbers == FLOOR) > 5), 0, numbers)
    floor = find_floor(Scene(points, lonely))
    assert floor is not None
    assert floor.source == "points"


@pytest.mark.parametrize(
    ("lowest", "metres", "stands"), [(0.0, 1.0, True), (0.6, 1.0, True), (1.4, 1.0, False), (1400.0, 0.001, False)]
)
def test_what_is_high_above_the_floor_does_not_stand_on_it(lowest: float, metres: float, stands: bool) -> None:
    floor = SceneFloor("z", 0.5, np.zeros(2), "labels", metres)
    rng = np.random.default_rng(0)
    points = rng.uniform([0, 0, lowest + 0.5], [1, 1, lowest + 1.0], (500, 3))
    assert floor.carries(points) == stands
    # One stray point below does not bring it down.
    points[0, 2] = 0.5
    assert floor.carries(points) == stands
    assert floor.height_under(points) == 0.5
    assert replace(floor, slope=np.array([1.0, 0.0])).height_under(points) == pytest.approx(1.0, abs=0.01)
