"""Packs of seeded synthetic furniture, and of things that are none, balanced over structural families."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from importlib import import_module

import numpy as np

from kpred.errors import ConfigError
from kpred.shapes.mesh import Mesh
from kpred.shapes.pack import MeshPack
from kpred.synthetic.assembly import assemble, cuboid_parts
from kpred.synthetic.part import Part

Family = Callable[[np.random.Generator], list[Part]]

_HOME = {
    "chair": ("chair.chair", "CHAIR_FAMILIES"),
    "table": ("table.table", "TABLE_FAMILIES"),
    "cabinet": ("cabinet.cabinet", "CABINET_FAMILIES"),
    "sofa": ("furnishings.sofas", "SOFA_FAMILIES"),
    "bed": ("furnishings.beds", "BED_FAMILIES"),
    "stool": ("furnishings.stools", "STOOL_FAMILIES"),
    "bench": ("furnishings.benches", "BENCH_FAMILIES"),
    "lamp": ("furnishings.lamps", "LAMP_FAMILIES"),
    "toilet": ("furnishings.bathroom", "TOILET_FAMILIES"),
    "bathtub": ("furnishings.bathroom", "BATHTUB_FAMILIES"),
    "sink": ("furnishings.bathroom", "SINK_FAMILIES"),
    "fridge": ("furnishings.appliances", "FRIDGE_FAMILIES"),
    "washing_machine": ("furnishings.appliances", "WASHING_FAMILIES"),
    "dishwasher": ("furnishings.appliances", "DISHWASHER_FAMILIES"),
    "oven": ("furnishings.kitchen", "OVEN_FAMILIES"),
    "range_hood": ("furnishings.kitchen", "HOOD_FAMILIES"),
    "microwave": ("furnishings.kitchen", "MICROWAVE_FAMILIES"),
    "toaster": ("furnishings.kitchen", "TOASTER_FAMILIES"),
    "display": ("furnishings.things", "DISPLAY_FAMILIES"),
    "trash_bin": ("furnishings.things", "BIN_FAMILIES"),
    "box": ("furnishings.things", "BOX_FAMILIES"),
    "plant": ("furnishings.things", "PLANT_FAMILIES"),
    "vase": ("furnishings.things", "VASE_FAMILIES"),
    "piano": ("furnishings.things", "PIANO_FAMILIES"),
    "door": ("furnishings.fixtures", "DOOR_FAMILIES"),
    "window": ("furnishings.fixtures", "WINDOW_FAMILIES"),
    "radiator": ("furnishings.fixtures", "RADIATOR_FAMILIES"),
    "mirror": ("furnishings.fixtures", "MIRROR_FAMILIES"),
    "fireplace": ("furnishings.fixtures", "FIREPLACE_FAMILIES"),
    "curtain": ("furnishings.fixtures", "CURTAIN_FAMILIES"),
    "other": ("others.others", "OTHER_FAMILIES"),
}
COARSE = ("chair", "table", "cabinet")
"""Categories with families of few plain boxes."""

_SOURCE_FRACTION, _TRAIN_FRACTION = 0.15, 0.70


class _Families(Mapping[str, dict[str, Family]]):
    """Category -> family name -> builder; a category's module is imported at first use."""

    def __getitem__(self, category: str) -> dict[str, Family]:
        module, name = _HOME[category]
        families: dict[str, Family] = getattr(import_module(f"kpred.synthetic.{module}"), name)
        return families

    def __iter__(self) -> Iterator[str]:
        return iter(_HOME)

    def __len__(self) -> int:
        return len(_HOME)


FAMILIES: Mapping[str, dict[str, Family]] = _Families()


def generate(
    category: str,
    count: int,
    seed: int,
    cuboids: float = 0.0,
    splits: bool = True,
    coarse: float = 0.0,
    family: str | None = None,
) -> MeshPack:
    """Pack of `count` shapes of a category of `FAMILIES`; the families take turns.

    Metres, y up, front +z, floor at y = 0, bounding box centred in x and z. Shape i depends only on category, seed
    and i, and a pack with a larger count begins with the same shapes. `cuboids` in [0, 1] is the fraction of shapes
    whose parts are replaced by their boxes, `coarse` that of shapes of few plain boxes (`COARSE_FAMILIES`, drawn by
    their weights; chairs, tables and cabinets have some). With `splits` 15 % of shapes are source, 70 % train and
    15 % val at random by seed, else all are source. `model_id` is family_seed_index; extra arrays: `factory` (the
    family), `seed`, `cuboid` (bool). `family`: only shapes of this one, whose name is the pack's category.

    Raises:
        ConfigError: unknown category or family, negative count or seed, `cuboids` or `coarse` outside [0, 1], or a
            category without coarse families.

    """
    if category not in FAMILIES:
        raise ConfigError(f"there is no generator for '{category}'; choose one of {', '.join(FAMILIES)}")
    if count < 0 or seed < 0:
        raise ConfigError(f"count and seed must not be negative, but are {count} and {seed}")
    for kind, fraction in (("cuboid", cuboids), ("coarse", coarse)):
        if not 0.0 <= fraction <= 1.0:
            raise ConfigError(f"the fraction of {kind} shapes must lie in [0, 1], but is {fraction}")
    if coarse and category not in COARSE:
        raise ConfigError(f"there are no coarse shapes of '{category}'; leave `coarse` at 0")
    if family is not None and family not in FAMILIES[category]:
        raise ConfigError(f"'{category}' has no family '{family}'; choose one of {', '.join(FAMILIES[category])}")
    names = list(FAMILIES[category]) if family is None else [family]
    labels: dict[str, int] = {}
    meshes: list[Mesh] = []
    boxed: list[bool] = []
    split: list[str] = []
    factories = [names[i % len(names)] for i in range(count)]
    if coarse:
        # Drawn apart too: the shapes that stay as they were keep their place.
        factories = [_coarse_or(name, category, [seed, i, 2], coarse) for i, name in enumerate(factories)]
    for i, factory in enumerate(factories):
        # Drawn apart from the geometry, so that the fraction of cuboids does not change the shapes themselves.
        lot, box_lot = np.random.default_rng([seed, i, 0]).random(2)
        split.append(_split_of(lot) if splits else "source")
        boxed.append(bool(box_lot < cuboids))
        parts = build(category, factory, [seed, i, 1])
        # Numbered in order of appearance: the numbers of a prefix stay as they are.
        for part in parts:
            labels.setdefault(part.label, len(labels))
        meshes.append(assemble(cuboid_parts(parts) if boxed[-1] else parts, f"{factory}_{seed}_{i}", list(labels)))
    return MeshPack.from_meshes(
        meshes,
        [mesh.name for mesh in meshes],
        split,
        family or category,
        part_names=list(labels),
        extra={
            "factory": np.array(factories, dtype=str),
            "seed": np.full(count, str(seed)),
            "cuboid": np.array(boxed, dtype=bool),
        },
    )


def build(category: str, family: str, seed: int | list[int]) -> list[Part]:
    """Build the parts of one shape of a family, coarse or not; equal seeds give equal shapes."""
    families: Mapping[str, Family] = FAMILIES[category]
    if family not in families:
        families = import_module("kpred.synthetic.coarse.coarse").COARSE_FAMILIES[category]
    return families[family](np.random.default_rng(seed))


def _coarse_or(family: str, category: str, seed: list[int], fraction: float) -> str:
    """Draw a coarse family's name with the probability `fraction`, else return the given one."""
    rng = np.random.default_rng(seed)
    if rng.random() >= fraction:
        return family
    name: str = import_module("kpred.synthetic.coarse.coarse").any_coarse_family(category, rng)
    return name


def _split_of(lot: float) -> str:
    if lot < _SOURCE_FRACTION:
        return "source"
    return "train" if lot < _SOURCE_FRACTION + _TRAIN_FRACTION else "val"
