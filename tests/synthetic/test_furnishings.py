"""Laws of the generator of furnishings beside chairs, tables and cabinets: sound parts, sizes, fronts."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from kpred.errors import ConfigError
from kpred.synthetic.assembly import assemble
from kpred.synthetic.generator import FAMILIES, build, generate
from kpred.synthetic.part import Part

Volume, Closed = Callable[[Part], float], Callable[[Part], bool]

CATEGORIES = [name for name in FAMILIES if name not in ("chair", "table", "cabinet", "other")]
EVERY = [(category, family) for category in CATEGORIES for family in FAMILIES[category]]

SIZES = {
    "sofa": (0.9, 3.6),
    "bed": (1.0, 3.2),
    "toilet": (0.35, 1.5),
    "bathtub": (1.1, 2.8),
    "fridge": (0.4, 2.3),
    "microwave": (0.3, 1.1),
    "toaster": (0.2, 0.5),
    "door": (1.8, 2.8),
    "vase": (0.1, 0.9),
}
"""Least and greatest longest side of some categories, metres; a microwave's door may stand open."""


def test_there_are_more_than_twenty_five_categories() -> None:
    assert len(FAMILIES) > 25
    assert len({family for _, family in EVERY}) == len(EVERY)


@pytest.mark.parametrize(("category", "family"), EVERY)
def test_every_family_builds_sound_parts_of_household_size(
    category: str, family: str, volume: Volume, is_closed: Closed
) -> None:
    low, high = SIZES.get(category, (0.1, 4.0))
    for seed in range(2):
        parts = build(category, family, seed)
        for part in parts:
            assert np.isfinite(part.vertices).all()
            assert volume(part) > 0.0, f"{family} {seed} {part.label}"
        # A closed surface uses each edge once in each direction; one part of a shape stands for those like it.
        for part in {part.label: part for part in parts}.values():
            assert is_closed(part), f"{family} {seed} {part.label}"
        mesh = assemble(parts)
        assert low < np.ptp(mesh.bounds, axis=0).max() < high, f"{family} {seed}"
        assert mesh.face_areas().min() > 0.0
        assert len(mesh.faces) < 8000


def _middle(parts: list[Part], *words: str) -> float:
    """Mean z of the parts with these labels."""
    chosen = [part.vertices[:, 2].mean() for part in parts if part.label in words]
    return float(np.mean(chosen))


@pytest.mark.parametrize(
    ("category", "family", "front", "rear"),
    [
        ("sofa", "sofa_three_seats", "seat_cushion", "back_cushion"),
        ("sofa", "slim_sofa", "seat_cushion", "back_cushion"),
        ("bed", "upholstered_bed", "mattress", "headboard"),
        ("bed", "sleigh_bed", "footboard", "headboard"),
        ("toilet", "close_coupled", "bowl", "cistern"),
        ("sink", "vanity", "door", "tap"),
        ("fridge", "two_door_fridge", "door", "body"),
        ("washing_machine", "front_loader", "door", "body"),
        ("oven", "cooker", "door", "body"),
        ("microwave", "microwave", "door", "body"),
        ("display", "tube_screen", "screen", "back"),
        ("range_hood", "hood", "rim", "shaft"),
        ("bench", "back_bench", "leg", "back_post"),
    ],
)
def test_fronts_look_along_z(category: str, family: str, front: str, rear: str) -> None:
    for seed in range(4):
        parts = build(category, family, seed)
        assert _middle(parts, front) > _middle(parts, rear), seed


def test_shapes_stay_in_longer_packs_and_families_take_turns() -> None:
    names = list(FAMILIES["lamp"])
    pack, shorter = generate("lamp", len(names), seed=3), generate("lamp", 4, seed=3)
    assert pack.category == "lamp" and list(pack.extra["factory"]) == names
    for i in range(4):
        assert np.array_equal(pack[i].vertices, shorter[i].vertices)
    assert not np.allclose(pack[0].bounds, generate("lamp", 1, seed=4)[0].bounds)


def test_coarse_shapes_are_refused_and_unknown_categories_list_all() -> None:
    with pytest.raises(ConfigError, match="no coarse shapes of 'sofa'"):
        generate("sofa", 2, seed=0, coarse=0.5)
    with pytest.raises(ConfigError, match="bathtub, sink"):
        generate("spaceship", 2, seed=0)
