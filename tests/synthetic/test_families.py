"""Laws of the table and cabinet families of the furniture generator."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.spatial import cKDTree

from kpred.ops.closest_point import closest_points
from kpred.synthetic.cabinet.cabinet import CABINET_FAMILIES
from kpred.synthetic.parts import Part, box
from kpred.synthetic.table.table import TABLE_FAMILIES

Family = Callable[[np.random.Generator], list[Part]]
FAMILIES = {f"table-{name}": family for name, family in TABLE_FAMILIES.items()} | {
    f"cabinet-{name}": family for name, family in CABINET_FAMILIES.items()
}
SEEDS = range(5)
TOUCH = 0.01  # metres: parts nearer than this count as joined

every_family = pytest.mark.parametrize("family", FAMILIES.values(), ids=FAMILIES.keys())


def draw(family: Family, seed: int) -> list[Part]:
    return family(np.random.default_rng([seed, 71]))


def bounds(parts: list[Part]) -> tuple[np.ndarray, np.ndarray]:
    points = np.concatenate([part.vertices for part in parts])
    return points.min(axis=0), points.max(axis=0)


def surface_points(part: Part, spacing: float) -> np.ndarray:
    """Points over the whole surface, no point of it farther than `spacing` from one of them."""
    points = []
    for a, b, c in part.vertices[part.faces]:
        # Cut along the longest side and towards the far corner, with steps that fit each direction.
        steps = max(1, int(np.ceil(max(np.linalg.norm(b - a), np.linalg.norm(c - a), np.linalg.norm(c - b)) / spacing)))
        u, v = np.meshgrid(np.arange(steps + 1), np.arange(steps + 1))
        keep = u + v <= steps
        points.append(a + (u[keep, None] * (b - a) + v[keep, None] * (c - a)) / steps)
    return np.concatenate(points)


def joined(a: Part, b: Part) -> bool:
    """Whether the surfaces of two parts come nearer than TOUCH."""
    low = np.maximum(a.vertices.min(axis=0), b.vertices.min(axis=0)) - TOUCH
    high = np.minimum(a.vertices.max(axis=0), b.vertices.max(axis=0)) + TOUCH
    if (low > high).any():
        return False
    for one, other in ((a, b), (b, a)):
        points = surface_points(one, 0.05)
        near = points[np.all((points >= low - 0.05) & (points <= high + 0.05), axis=1)]
        if len(near) and closest_points(near, other.vertices, other.faces)[0].min() <= TOUCH:
            return True
    fine_a, fine_b = surface_points(a, 0.012), surface_points(b, 0.012)
    fine_a = fine_a[np.all((fine_a >= low) & (fine_a <= high), axis=1)]
    return bool(len(fine_a)) and bool(cKDTree(fine_b).query(fine_a)[0].min() <= TOUCH)


def loose_parts(parts: list[Part]) -> list[str]:
    """Labels of the parts that do not hang together with the first one."""
    reached, edge = {0}, [0]
    while edge:
        here = edge.pop()
        for other in set(range(len(parts))) - reached:
            if joined(parts[here], parts[other]):
                reached.add(other)
                edge.append(other)
    return [parts[index].label for index in sorted(set(range(len(parts))) - reached)]


def test_there_are_many_families() -> None:
    assert len(TABLE_FAMILIES) >= 16
    assert len(CABINET_FAMILIES) >= 16


@every_family
def test_one_seed_gives_one_shape_and_seeds_differ(family: Family) -> None:
    first, again, other = draw(family, 3), draw(family, 3), draw(family, 4)
    assert [part.label for part in first] == [part.label for part in again]
    for one, two in zip(first, again, strict=True):
        np.testing.assert_array_equal(one.vertices, two.vertices)
        np.testing.assert_array_equal(one.faces, two.faces)
    assert not np.allclose(np.concatenate(bounds(first)), np.concatenate(bounds(other)))


@every_family
def test_surfaces_are_sound(family: Family) -> None:
    for seed in SEEDS:
        parts = draw(family, seed)
        assert sum(len(part.faces) for part in parts) < 2000
        for part in parts:
            a, b, c = (part.vertices[part.faces[:, k]] for k in range(3))
            assert np.isfinite(part.vertices).all()
            normals = np.cross(b - a, c - a)
            assert np.linalg.norm(normals, axis=1).min() > 1e-8, part.label
            volume = np.einsum("ij,ij->i", a, normals).sum() / 6
            assert volume > 0, f"{part.label} is inside out"


@every_family
def test_sizes_are_those_of_furniture(family: Family) -> None:
    table = family in TABLE_FAMILIES.values()
    for seed in SEEDS:
        low, high = bounds(draw(family, seed))
        width, height, depth = high - low
        assert abs(low[1]) < 0.05  # slanted legs may dip a little below the floor; assembling lifts them
        assert 0.25 < width < (4.3 if table else 2.6)
        assert 0.28 < height < (1.7 if table else 2.5)
        assert 0.15 < depth < (2.2 if table else 0.8)


@every_family
def test_no_part_floats(family: Family) -> None:
    assert loose_parts(draw(family, 0)) == []


@pytest.mark.parametrize("family", CABINET_FAMILIES.values(), ids=CABINET_FAMILIES.keys())
def test_fronts_of_cabinets_look_forward(family: Family) -> None:
    for seed in SEEDS:
        parts = draw(family, seed)
        low, high = bounds(parts)
        for part in parts:
            if part.label in ("door", "drawer", "handle", "flap"):
                assert part.vertices[:, 2].mean() > (low[2] + high[2]) / 2, part.label


def test_drawers_of_desks_are_at_the_sitters_side() -> None:
    for name in ("pedestal_desk", "writing_desk", "hutch_desk"):
        for seed in SEEDS:
            parts = draw(TABLE_FAMILIES[name], seed)
            assert all(part.vertices[:, 2].mean() > 0 for part in parts if part.label == "drawer")


def test_the_check_for_loose_parts_sees_a_gap() -> None:
    board = box((1, 0.02, 1), (0, 0.5, 0), "top")
    crossing = box((0.05, 1.0, 0.05), (0.2, 0.5, 0.2), "leg")
    assert loose_parts([board, crossing, box((0.05, 0.485, 0.05), (0, 0.2425, 0), "leg")]) == []
    assert loose_parts([board, box((0.05, 0.46, 0.05), (0, 0.23, 0), "short")]) == ["short"]
