"""Laws of the coarse families of the furniture generator: few plain boxes, sound and joined, that face +z."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from kpred.errors import ConfigError
from kpred.shapes.mesh import Mesh
from kpred.synthetic.assembly import assemble
from kpred.synthetic.coarse.coarse import COARSE_FAMILIES
from kpred.synthetic.generator import FAMILIES, build, generate
from kpred.synthetic.part import Part
from kpred.synthetic.parts import box

CATEGORIES = list(COARSE_FAMILIES)
EVERY = [(category, family) for category in CATEGORIES for family in COARSE_FAMILIES[category]]

REACH = 0.006
"""Metres: boxes whose bodies come nearer than this count as joined."""

every_family = pytest.mark.parametrize(("category", "family"), EVERY)


@every_family
def test_shapes_are_few_sound_boxes_that_hang_together(category: str, family: str) -> None:
    for seed in range(6):
        parts = build(category, family, seed)
        assert len({part.label for part in parts}) > 1
        assert len(parts) < 90, f"{family} {seed}"
        for part in parts:
            assert len(part.vertices) == 8 and len(part.faces) == 12
            assert (sides(part) @ np.append(part.vertices.mean(axis=0), 1.0) < 0).all(), "inside out"
        assert not loose(parts), f"{family} {seed}"
        mesh = assemble(parts)
        low, high = mesh.bounds
        assert mesh.face_areas().min() > 1e-9
        assert ((high - low) > 0.15).all() and ((high - low) < 3.5).all(), f"{family} {seed}"


@every_family
def test_one_seed_gives_one_shape_and_seeds_differ(category: str, family: str) -> None:
    first, again, other = (assemble(build(category, family, seed)) for seed in (3, 3, 4))
    assert np.array_equal(first.vertices, again.vertices) and np.array_equal(first.faces, again.faces)
    assert not np.array_equal(first.bounds, other.bounds)


@pytest.mark.parametrize("family", COARSE_FAMILIES["chair"])
def test_what_rises_above_a_chairs_seat_lies_to_the_back(family: str, upper_z: Callable[[Mesh], float]) -> None:
    for seed in range(8):
        assert upper_z(assemble(build("chair", family, seed))) < -0.003, f"{family} {seed}"


@pytest.mark.parametrize("family", COARSE_FAMILIES["cabinet"])
def test_leaves_of_cases_lie_to_the_front(family: str) -> None:
    for seed in range(8):
        for part in build("cabinet", family, seed):
            middle = part.vertices[:, 2].mean()
            if part.label in ("handle", "stile") or (part.label == "door" and family != "case_ajar"):
                assert middle > -0.03, f"{family} {seed} {part.label}"
            if part.label == "back":
                assert middle < 0.0, f"{family} {seed}"


def test_backless_cases_are_closed_in_front_alone() -> None:

    for seed in range(8):
        parts = build("cabinet", "backless_case", seed)
        assert not any(part.label == "back" for part in parts)
        assert any(part.label in ("door", "drawer") for part in parts)


@pytest.mark.parametrize("category", CATEGORIES)
def test_a_share_of_coarse_shapes_leaves_the_others_as_they_were(category: str) -> None:
    fine, mixed, coarse = (generate(category, 24, seed=5, coarse=fraction) for fraction in (0.0, 0.5, 1.0))
    names = set(COARSE_FAMILIES[category])
    assert not names & set(FAMILIES[category])
    assert set(coarse.extra["factory"]) <= names
    changed = np.isin(mixed.extra["factory"], list(names))
    assert 4 < changed.sum() < 20
    for i in range(24):
        source = coarse if changed[i] else fine
        assert mixed.model_id[i] == source.model_id[i]
        assert np.array_equal(mixed[i].vertices, source[i].vertices)
    assert list(mixed.split) == list(fine.split)


def test_there_are_no_coarse_other_things_and_shares_are_shares() -> None:
    with pytest.raises(ConfigError, match="no coarse shapes"):
        generate("other", 3, 0, coarse=0.5)
    with pytest.raises(ConfigError, match="coarse shapes must lie"):
        generate("chair", 3, 0, coarse=1.5)


def test_the_check_for_loose_boxes_sees_a_gap() -> None:
    board = box((1.0, 0.02, 1.0), (0.0, 0.5, 0.0), "top")
    assert loose([board, box((0.05, 0.5, 0.05), (0.2, 0.25, 0.2), "leg")]) == []
    assert loose([board, box((0.05, 0.46, 0.05), (0.2, 0.23, 0.2), "short")]) == ["short"]


def sides(part: Part) -> np.ndarray:
    """Planes (12, 4) of a convex part's faces: normal and offset; negative inside."""
    a, b, c = (part.vertices[part.faces[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return np.column_stack([normals, -np.einsum("ij,ij->i", normals, a)])


def loose(parts: list[Part]) -> list[str]:
    """Labels of the boxes that do not hang together with the first one."""
    grid = np.stack(np.meshgrid(*[np.linspace(0.0, 1.0, 9)] * 3), axis=-1).reshape(-1, 3)
    clouds = [frame_points(part.vertices, grid) for part in parts]
    reached, waiting = {0}, [0]
    while waiting:
        here = waiting.pop()
        for other in set(range(len(parts))) - reached:
            if any(
                ((np.column_stack([clouds[a], np.ones(len(grid))]) @ sides(parts[b]).T).max(axis=1) < REACH).any()
                for a, b in ((here, other), (other, here))
            ):
                reached.add(other)
                waiting.append(other)
    return [parts[k].label for k in range(len(parts)) if k not in reached]


def frame_points(corners: np.ndarray, grid: np.ndarray) -> np.ndarray:
    """Points all through a hexahedron of two rings of four corners."""
    u, v, w = grid[:, :1], grid[:, 1:2], grid[:, 2:]
    low, high = (
        (1 - u) * ((1 - v) * ring[0] + v * ring[3]) + u * ((1 - v) * ring[1] + v * ring[2])
        for ring in (corners[:4], corners[4:])
    )
    return np.asarray((1 - w) * low + w * high)
