"""Laws of the generator of things that are neither chair, table nor cabinet."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from kpred.errors import ConfigError
from kpred.shapes.pack import MeshPack
from kpred.synthetic.assembly import assemble
from kpred.synthetic.generator import FAMILIES, build, generate
from kpred.synthetic.organic import bumpy_ball, capsule, ellipsoid, leaf, ring, rotated, vessel
from kpred.synthetic.others.others import generate_others
from kpred.synthetic.part import Part, rotation_matrix
from kpred.synthetic.parts import ellipse

Volume, Closed = Callable[[Part], float], Callable[[Part], bool]

NAMES = list(FAMILIES["other"])
PRIMITIVES = {
    "ellipsoid": ellipsoid((0.3, 0.1, 0.2), (1, 2, 3), "a"),
    "capsule": capsule((0, 0, 0), (0.3, 0.5, -0.1), 0.1, "a", 0.05),
    "bumpy ball": bumpy_ball(np.random.default_rng(0), (0.3, 0.3, 0.2), (5, 0, 0), "a", bump=0.5),
    "leaf": leaf((0, 0, 0), (0.5, 0.2, 0.1), 0.08, 0.05),
    "ring": ring(0.3, 0.05, (1, 1, 1), "a"),
    "vessel": vessel([ellipse(0.2, 0.3, 12), ellipse(0.4, 0.5, 12)], [0.0, 0.4], 0.02, "a"),
    "turned": rotated(ellipsoid((0.3, 0.1, 0.2), (1, 2, 3), "a"), rotation_matrix((1, 2, 3), 70), (9, 9, 9)),
}


@pytest.mark.parametrize("name", PRIMITIVES)
def test_primitives_are_closed_and_wound_outward(name: str, volume: Volume, is_closed: Closed) -> None:
    assert is_closed(PRIMITIVES[name])
    assert volume(PRIMITIVES[name]) > 0.0


def test_primitives_have_the_volumes_of_the_solids(volume: Volume) -> None:
    fine = ellipsoid((0.3, 0.1, 0.2), (1, 2, 3), "a", sides=80, rings=60)
    assert volume(fine) == pytest.approx(4.0 / 3.0 * np.pi * 0.3 * 0.1 * 0.2, rel=0.01)
    tyre = ring(0.3, 0.05, (0, 0, 0), "a", sides=96)
    hexagon = 6 * 0.5 * 0.025**2 * np.sin(np.pi / 3)
    assert volume(tyre) == pytest.approx(2.0 * np.pi * 0.3 * hexagon, rel=0.01)
    outer, inner = 0.4 * 0.4 * 1.0, 0.3 * 0.3 * 0.95
    square = np.array([[0.2, 0.2], [-0.2, 0.2], [-0.2, -0.2], [0.2, -0.2]])
    assert volume(vessel([square, square], [0.0, 1.0], 0.05, "a")) == pytest.approx(outer - inner)


@pytest.mark.parametrize("family", NAMES)
def test_every_family_builds_sound_parts(family: str, volume: Volume, is_closed: Closed) -> None:
    for seed in range(6):
        for part in build("other", family, seed):
            assert np.isfinite(part.vertices).all()
            assert is_closed(part), f"{family} {seed} {part.label}"
            assert volume(part) > 0.0, f"{family} {seed} {part.label}"


@pytest.mark.parametrize("family", NAMES)
def test_sizes_are_those_of_things_in_rooms(family: str) -> None:
    for seed in range(12):
        low, high = assemble(build("other", family, seed)).bounds
        assert low[1] == pytest.approx(0.0, abs=1e-6)
        assert np.abs((low + high)[[0, 2]]).max() < 1e-5
        assert 0.05 < (high - low).max() < 6.0, f"{family} {seed}"


@pytest.mark.parametrize("family", NAMES)
def test_one_seed_gives_one_shape_and_seeds_differ(family: str) -> None:
    first, again, other = (assemble(build("other", family, seed)) for seed in (3, 3, 4))
    assert np.array_equal(first.vertices, again.vertices)
    assert not np.allclose(first.bounds, other.bounds)


@pytest.fixture(scope="module")
def pack() -> MeshPack:
    return generate_others(len(NAMES), seed=5)


def test_the_families_take_turns_in_a_pack_of_the_category_other(pack: MeshPack) -> None:
    assert pack.category == "other"
    assert len(NAMES) >= 18
    assert list(pack.extra["factory"]) == NAMES
    assert list(pack.model_id[:2]) == [f"{NAMES[0]}_5_0", f"{NAMES[1]}_5_1"]
    for mesh in pack:
        assert mesh.face_areas().min() > 0.0, mesh.name
        assert len(mesh.faces) < 6000, mesh.name


def test_a_larger_pack_begins_with_the_same_shapes(pack: MeshPack) -> None:
    small = generate("other", 9, seed=5)
    for i in range(9):
        assert np.array_equal(small[i].vertices, pack[i].vertices)
        assert np.array_equal(small[i].faces, pack[i].faces)
    assert list(small.split) == list(pack.split[:9])


def test_furniture_that_fell_does_not_stand_as_it_was_built() -> None:
    """The back of a fallen chair is no longer its highest part in every shape; upright chairs have it there."""
    tops = []
    for seed in range(30):
        parts = build("other", "fallen_furniture", seed)
        backs = [part for part in parts if part.label.startswith("back")]
        if backs:
            highest = max(part.vertices[:, 1].max() for part in parts)
            tops.append(max(part.vertices[:, 1].max() for part in backs) > highest - 0.02)
    assert len(tops) >= 8 and np.mean(tops) < 0.7


def test_two_pieces_are_wider_than_one() -> None:
    spans = [np.ptp(assemble(build("other", "two_pieces", seed)).bounds[:, [0, 2]], axis=0).max() for seed in range(12)]
    assert min(spans) > 0.7 and np.median(spans) > 1.1


def test_a_negative_count_is_refused() -> None:
    with pytest.raises(ConfigError, match="negative"):
        generate_others(-1, 0)
