"""Laws of the furniture generator that hold for every category and family."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable

import numpy as np
import pytest
from scipy.spatial import cKDTree

from kpred.errors import ConfigError, MeshError
from kpred.shapes.mesh import Mesh
from kpred.shapes.pack import MeshPack
from kpred.synthetic.assembly import assemble, cuboid_parts
from kpred.synthetic.generator import FAMILIES, build, generate
from kpred.synthetic.part import Part
from kpred.synthetic.parts import (
    beam,
    box,
    curved_panel,
    cushion,
    cylinder,
    ellipse,
    frustum,
    lathe,
    rounded_rectangle,
    slab,
    sweep,
)

Volume, Closed = Callable[[Part], float], Callable[[Part], bool]

CATEGORIES = [name for name in FAMILIES if importlib.util.find_spec(f"kpred.synthetic.{name}")]
EVERY_FAMILY = [(category, family) for category in CATEGORIES for family in FAMILIES[category]]
BACKLESS = {"stool", "round_stool", "bar_stool", "bar_chair", "bench", "folding", "ottoman"}

_TURN = np.linspace(0.0, 3.0, 10)
_NOTCHED = np.array([[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]], dtype=float)
PRIMITIVES = {
    "box": box((1, 2, 3), (5, 5, 5), "a"),
    "frustum": frustum((1, 1), (0.5, 0.25), (0, 0, 0), (0.3, 1, 0.2), "a"),
    "cylinder": cylinder(0.5, (0, 0, 0), (1, 1, 0), "a"),
    "cone": cylinder(0.5, (0, 1, 0), (0, 0, 0), "a", end_radius=0.2),
    "lathe": lathe([(0.1, 0), (0.2, 0.2), (0.2, 0.3), (0, 0.4)], (1, 0, 0), "a"),
    "sweep": sweep(ellipse(0.1, 0.1, 8), np.column_stack([np.sin(_TURN), np.cos(_TURN), _TURN / 3]), "a"),
    "beam": beam((0, 0, 0), (0.1, 1, 0.2), 0.1, 0.2, "a"),
    "notched slab": slab(_NOTCHED, 1.0, 0.1, "a"),
    "reversed slab": slab(_NOTCHED[::-1], 1.0, 0.1, "a"),
    "rounded slab": slab(rounded_rectangle(1, 2, 0.2), 0.0, 0.1, "a"),
    "curved panel": curved_panel(0.5, 0.5, 0.02, 0.05, 10, (0, 1, 0), "a"),
    "cushion": cushion((0.5, 0.2, 0.4), (0, 0, 0), "a"),
}


@pytest.mark.parametrize("name", PRIMITIVES)
def test_primitives_are_closed_and_wound_outward_however_they_are_moved(
    name: str, volume: Volume, is_closed: Closed
) -> None:
    part = PRIMITIVES[name]
    for moved in (
        part,
        part.mirrored_x(),
        part.rotated("z", 40, (1, 2, 3)),
        part.scaled((1, 2, 3)),
        part.moved((9, 9, 9)),
    ):
        assert is_closed(moved)
        assert volume(moved) > 0.0


def test_primitive_volumes_are_those_of_the_solids(volume: Volume) -> None:
    assert volume(PRIMITIVES["box"]) == pytest.approx(6.0)
    assert volume(PRIMITIVES["notched slab"]) == pytest.approx(0.3)
    assert volume(cylinder(0.5, (0, 0, 0), (0, 2, 0), "a", sides=200)) == pytest.approx(np.pi / 2, rel=1e-3)
    assert volume(beam((0, 0, 0), (3, 0, 0), 0.1, 0.2, "a")) == pytest.approx(0.06)


def test_a_bent_tube_keeps_its_thickness_through_a_right_angle(volume: Volume) -> None:
    square = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * 0.05
    elbow = sweep(square, np.array([[0, 0, 0], [1, 0, 0], [1, 0, 1]], dtype=float), "a")
    assert volume(elbow) == pytest.approx(2.0 * 0.01)


def test_a_leaned_panel_tips_its_top_to_the_back() -> None:
    panel = curved_panel(0.5, 1.0, 0.02, 0.0, 20, (0, 0, 0), "a")
    top = panel.vertices[:, 1] > 0.0
    assert panel.vertices[top, 2].mean() < -0.1
    hollow = curved_panel(0.5, 1.0, 0.02, 0.1, 0, (0, 0, 0), "a").vertices
    assert hollow[np.abs(hollow[:, 0]) < 0.01, 2].mean() < hollow[np.abs(hollow[:, 0]) > 0.24, 2].mean() - 0.09


@pytest.mark.parametrize("name", ["box", "frustum", "beam", "lathe", "cushion", "curved panel", "cylinder"])
def test_the_cuboid_of_a_part_encloses_it_and_turns_with_it(name: str, volume: Volume, is_closed: Closed) -> None:
    part = PRIMITIVES[name]
    (block,) = cuboid_parts([part])
    assert len(block.faces) == 12 and is_closed(block)
    axes = block.axes
    assert (part.vertices @ axes.T).max(axis=0) == pytest.approx((block.vertices @ axes.T).max(axis=0))
    (turned,) = cuboid_parts([part.rotated((1, 2, 3), 50)])
    assert volume(turned) == pytest.approx(volume(block))


def test_a_strongly_bent_sweep_becomes_several_cuboids_and_a_straight_one_stays_one(
    volume: Volume,
) -> None:
    corner = sweep(ellipse(0.02, 0.02, 6), np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float), "a")
    blocks = cuboid_parts([corner])
    assert len(blocks) == 3
    assert sum(volume(block) for block in blocks) < 0.01
    straight = sweep(ellipse(0.02, 0.02, 6), np.array([[0, 0, 0], [1, 0, 0], [2, 0.1, 0]], dtype=float), "a")
    assert len(cuboid_parts([straight])) == 1


def test_assembling_nothing_is_refused() -> None:
    with pytest.raises(MeshError, match="no parts"):
        assemble([], "empty")


@pytest.fixture(scope="module", params=CATEGORIES)
def pack(request: pytest.FixtureRequest) -> MeshPack:
    category = request.param
    return generate(category, 3 * len(FAMILIES[category]), seed=5)


def test_there_are_at_least_twelve_families_and_they_take_turns(pack: MeshPack) -> None:
    names, counts = np.unique(pack.extra["factory"], return_counts=True)
    assert set(names) == set(FAMILIES[pack.category]) and len(names) >= 12
    assert (counts == 3).all()
    assert pack.model_id[0] == f"{pack.extra['factory'][0]}_5_0"
    assert len(set(pack.model_id)) == len(pack)


def test_shapes_depend_only_on_seed_and_place(pack: MeshPack) -> None:
    again = generate(pack.category, 7, seed=5)
    for i in range(7):
        assert np.array_equal(again[i].vertices, pack[i].vertices)
        assert np.array_equal(again[i].faces, pack[i].faces)
        assert np.array_equal(again[i].face_parts, pack[i].face_parts)
    assert list(again.split) == list(pack.split[:7])
    assert list(again.part_names) == list(pack.part_names[: len(again.part_names)])
    other = generate(pack.category, 7, seed=6)
    assert not any(np.array_equal(other[i].vertices, pack[i].vertices) for i in range(7))


def test_shapes_stand_centred_on_the_floor_in_sane_metres(pack: MeshPack) -> None:
    for mesh in pack:
        low, high = mesh.bounds
        assert np.isfinite(mesh.vertices).all()
        assert abs(low[1]) < 1e-6
        assert np.abs((low + high)[[0, 2]]).max() < 1e-5
        assert ((high - low) > 0.15).all() and ((high - low) < 3.5).all(), mesh.name


def test_faces_have_area_a_named_part_and_a_modest_count(pack: MeshPack) -> None:
    assert pack.part_names is not None
    for mesh in pack:
        assert mesh.face_areas().min() > 1e-9, mesh.name
        assert len(mesh.faces) < 2500, mesh.name
        parts = mesh.face_parts
        assert parts is not None and parts.min() >= 0 and parts.max() < len(pack.part_names)
        assert len(np.unique(parts)) > 1, mesh.name


def test_cuboids_change_the_look_and_nothing_else(pack: MeshPack) -> None:
    count = len(FAMILIES[pack.category])
    boxes = generate(pack.category, count, seed=5, cuboids=1.0)
    assert boxes.extra["cuboid"].all()
    assert list(boxes.model_id) == list(pack.model_id[:count])
    for i in range(count):
        assert len(boxes[i].vertices) * 12 == len(boxes[i].faces) * 8
        assert boxes[i].face_areas().min() > 1e-9
        assert np.abs(boxes[i].bounds - pack[i].bounds).max() < 0.35, boxes[i].name
    some = generate(pack.category, count, seed=5, cuboids=0.5).extra["cuboid"]
    assert 0.15 < some.mean() < 0.85


def test_splits_have_their_shares() -> None:
    splits = generate("chair", 400, seed=1, coarse=1.0).split  # coarse shapes are quick
    assert (splits == "source").mean() == pytest.approx(0.15, abs=0.05)
    assert (splits == "train").mean() == pytest.approx(0.70, abs=0.06)
    assert set(generate("chair", 5, seed=1, splits=False).split) == {"source"}


@pytest.mark.parametrize(("category", "family"), EVERY_FAMILY)
def test_parts_are_closed_and_hang_together(category: str, family: str, volume: Volume, is_closed: Closed) -> None:
    for seed in range(2):
        parts = build(category, family, seed)
        for part in parts:
            assert is_closed(part) and volume(part) > 0.0, part.label
        loose = loose_labels(parts, reach=0.01)
        assert not loose, f"{family} {seed}: {loose}"


@pytest.mark.parametrize("family", [name for name in FAMILIES["chair"] if name not in BACKLESS])
def test_what_rises_above_a_chairs_seat_lies_to_the_back(family: str, upper_z: Callable[[Mesh], float]) -> None:
    for seed in range(4):
        assert upper_z(assemble(build("chair", family, seed))) < -0.003, f"{family} {seed}"


@pytest.mark.parametrize("family", FAMILIES["chair"])
def test_back_parts_of_chairs_stand_behind_the_middle(family: str) -> None:
    for seed in range(4):
        parts = build("chair", family, seed)
        seat = np.concatenate([part.vertices for part in parts if part.label.startswith(("seat", "shell"))])
        for part in parts:
            if part.label.startswith("back"):
                assert part.vertices[:, 2].mean() < seat[:, 2].mean() - 0.05, f"{family} {seed} {part.label}"
                assert part.vertices[:, 1].max() > seat[:, 1].min()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("spaceship", 3, 0), "spaceship"),
        (("chair", -1, 0), "negative"),
        (("chair", 3, -1), "negative"),
        (("chair", 3, 0, 1.5), "fraction"),
    ],
)
def test_bad_arguments_are_refused(arguments: tuple, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        generate(*arguments)


def test_a_family_alone_is_a_category_of_its_own() -> None:
    pack = generate("other", 3, 5, splits=False, family="bicycle")
    assert pack.category == "bicycle"
    assert set(pack.extra["factory"]) == {"bicycle"}
    with pytest.raises(ConfigError, match="no family 'spaceship'.*bicycle"):
        generate("other", 3, 5, family="spaceship")


def test_no_shapes_make_an_empty_pack() -> None:
    assert len(generate("chair", 0, seed=0)) == 0


def surface_points(part: Part, rng: np.random.Generator, spacing: float) -> np.ndarray:
    mesh = Mesh(part.vertices, part.faces)
    areas = mesh.face_areas()
    count = int(np.clip(2.0 * areas.sum() / spacing**2, 200, 4000))
    corners = part.vertices[part.faces[rng.choice(len(areas), count, p=areas / areas.sum())]]
    weights = rng.dirichlet((1.0, 1.0, 1.0), count)
    return np.concatenate([part.vertices, np.einsum("nc,ncd->nd", weights, corners)])


def loose_labels(parts: list[Part], reach: float) -> set[str]:
    """Labels of parts that no chain of touching parts joins to the first one; surfaces within `reach` metres touch."""
    rng = np.random.default_rng(0)
    clouds = [surface_points(part, rng, reach) for part in parts]
    trees = [cKDTree(cloud) for cloud in clouds]
    lows, highs = np.array([c.min(axis=0) for c in clouds]), np.array([c.max(axis=0) for c in clouds])
    reached, waiting = {0}, [0]
    while waiting:
        i = waiting.pop()
        near = (lows <= highs[i] + reach).all(axis=1) & (highs >= lows[i] - reach).all(axis=1)
        for j in np.flatnonzero(near):
            if int(j) in reached:
                continue
            small, large = (i, j) if len(clouds[i]) < len(clouds[j]) else (j, i)
            if trees[large].query(clouds[small], distance_upper_bound=reach)[0].min() <= reach:
                reached.add(int(j))
                waiting.append(int(j))
    return {parts[j].label for j in range(len(parts)) if j not in reached}
