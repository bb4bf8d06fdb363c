"""Shapes that furnish rooms: by role, from the generator's families and from mesh packs, kept once made."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kpred.shapes.mesh import Mesh
from kpred.shapes.pack import MeshPack
from kpred.synthetic.assembly import assemble
from kpred.synthetic.generator import build
from kpred.synthetic.rooms.room import OTHER

VARIETY = 400
"""Different shapes of each family that a catalogue holds at most."""


@dataclass(frozen=True)
class Role:
    """What a piece of furniture is for.

    Attributes:
        category: label of the objects; source: category of the generator and of the packs that shapes come from.
        families: of the generator; factories: values of a pack's array `factory`, all where it has none.
    """

    category: str
    source: str
    families: tuple[str, ...]
    factories: tuple[str, ...] = ()


ROLES = {
    "dining chair": Role(
        "chair",
        "chair",
        (
            *("dining_panel", "dining_slats", "dining_ladder", "dining_splat", "dining_upholstered", "dining_hoop"),
            *("windsor", "armchair_wooden", "stool", "round_stool", "folding", "cantilever", "sled", "shell_legs"),
            *("block_seat", "side_frame", "tulip", "plank", "three_legged", "throne"),
        ),
        ("ChairFactory",),
    ),
    "office chair": Role(
        "chair",
        "chair",
        ("office_task", "office_executive", "swivel_tub", "shell_base", "cantilever", "pedestal", "office_task"),
        ("OfficeChairFactory", "ChairFactory"),
    ),
    "armchair": Role(
        "chair",
        "chair",
        (
            *("club", "slipper", "wing", "recliner", "barrel", "cube", "lounger", "rocking", "swivel_tub", "garden"),
            *("ottoman", "club"),
        ),
    ),
    "bar stool": Role("chair", "chair", ("bar_chair", "bar_stool"), ("BarChairFactory",)),
    "dining table": Role(
        "table",
        "table",
        (
            *("dining", "round", "pedestal", "double_pedestal", "trestle", "x_leg", "slab", "frame", "drop_leaf"),
            *("conference", "sculpted", "sled", "drawer_side"),
        ),
        ("TableDiningFactory",),
    ),
    "desk": Role(
        "table",
        "table",
        (
            *("pedestal_desk", "writing_desk", "hutch_desk", "l_desk", "t_leg_desk", "panel_desk", "open_bay_desk"),
            *("counter_desk", "drafting", "workbench", "dining", "frame"),
        ),
        ("SimpleDeskFactory",),
    ),
    "low table": Role(
        "table",
        "table",
        ("coffee", "nesting", "c_shape", "cube", "tripod", "sculpted", "sled", "console", "round"),
        ("CoffeeTableFactory", "SideTableFactory", "TableCocktailFactory"),
    ),
    "bar table": Role("table", "table", ("bar", "counter_desk")),
    "tall cabinet": Role(
        "cabinet",
        "cabinet",
        (
            *("wardrobe", "sliding_wardrobe", "tall_cabinet", "cornice", "locker", "open_bookcase", "cube_grid"),
            *("bookcase_with_doors", "glass", "hutch", "rack", "ladder", "asymmetric", "secretary", "display_steps"),
        ),
        ("LargeShelfFactory", "SimpleBookcaseFactory", "SingleCabinetFactory", "CellShelfFactory"),
    ),
    "low cabinet": Role(
        "cabinet",
        "cabinet",
        (
            *("chest_of_drawers", "sideboard", "tv_stand", "kitchen_base", "filing_cabinet", "nightstand"),
            *("shoe_cabinet", "apothecary", "stepped", "round_shelf", "filing_cabinet"),
        ),
        ("KitchenCabinetFactory",),
    ),
    "nightstand": Role("cabinet", "cabinet", ("nightstand", "chest_of_drawers", "filing_cabinet")),
    "wall cabinet": Role(
        "cabinet", "cabinet", ("wall_cabinet", "wall_cabinet", "sideboard", "cube_grid", "asymmetric", "stepped")
    ),
    "sofa": Role(OTHER, "chair", ("sofa_two", "sofa_three", "chaise")),
    "bed": Role(OTHER, "other", ("bed",)),
    "plant": Role(OTHER, "other", ("potted_plant",)),
    "lamp": Role(OTHER, "other", ("floor_lamp",)),
    "desk lamp": Role(OTHER, "other", ("desk_lamp",)),
    "screen": Role(OTHER, "other", ("screen",)),
    "vessel": Role(OTHER, "other", ("vessel",)),
    "floor thing": Role(
        OTHER,
        "other",
        (
            *("backpack", "luggage", "open_box", "rolled_carpet", "vessel", "blob", "ball", "person", "bicycle"),
            *("ladder", "heap", "open_box", "blob"),
        ),
    ),
    "wall thing": Role(OTHER, "other", ("radiator", "piano", "toilet", "bathtub", "sink", "tree")),
    "soft thing": Role(OTHER, "other", ("blob", "backpack")),
}


class Catalogue:
    """Shapes by role and number; equal seeds and packs give equal shapes.

    Args:
        seed: of the generator's shapes.
        packs: mesh packs (metres, y up, front +z) of chairs, tables or cabinets, whose splits are used half the time
            where a role knows their factories.
        splits: splits of the packs that are used.
    """

    def __init__(self, seed: int, packs: Sequence[MeshPack] = (), splits: Sequence[str] = ("source", "train")) -> None:
        self.seed = seed
        self._packs = list(packs)
        self._made: dict[tuple[str, str, int], Mesh] = {}
        self._choices = {
            name: [
                (number, int(row))
                for number, pack in enumerate(self._packs)
                if pack.category == role.source
                for row in np.flatnonzero(np.isin(pack.split, list(splits)) & _of_factories(pack, role.factories))
            ]
            for name, role in ROLES.items()
        }

    def draw(self, role: str, rng: np.random.Generator) -> Mesh:
        """Draw a shape for a role: metres, y up, front +z, floor at y = 0, box centred in x and z."""
        rows = self._choices[role]
        if rows and rng.random() < 0.5:
            number, row = rows[int(rng.integers(len(rows)))]
            return self._kept(("pack", str(number), row))
        families = ROLES[role].families
        family = families[int(rng.integers(len(families)))]
        return self._kept((ROLES[role].source, family, int(rng.integers(VARIETY))))

    def _kept(self, key: tuple[str, str, int]) -> Mesh:
        if key not in self._made:
            self._made[key] = self._make(*key)
        return self._made[key]

    def _make(self, source: str, name: str, number: int) -> Mesh:
        if source == "pack":
            pack = self._packs[int(name)]
            mesh = pack[number]
            factory = str(pack.extra["factory"][number]) if "factory" in pack.extra else pack.category
            return Mesh(_grounded(mesh.vertices), np.array(mesh.faces), factory)
        letters = [ord(letter) for letter in f"{source} {name}"]
        mesh = assemble(build(source, name, [self.seed, number, *letters]), name)
        return Mesh(mesh.vertices, mesh.faces, name)


def _of_factories(pack: MeshPack, factories: tuple[str, ...]) -> np.ndarray:
    if "factory" not in pack.extra:
        return np.full(len(pack), bool(factories))
    return np.isin(pack.extra["factory"], list(factories))


def _grounded(vertices: np.ndarray) -> np.ndarray:
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    middle = (low + high) / 2
    return np.asarray(vertices - np.array([middle[0], low[1], middle[2]]), dtype=np.float32)
