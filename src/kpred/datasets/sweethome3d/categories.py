"""Category of a Sweet Home 3D model, by the words of its title or, where these mislead, by its key."""

from __future__ import annotations

import re

from kpred.datasets.sweethome3d.library import LibraryModel

_BY_KEY = {
    "Blend Swap CC-0#deckChair": "lounger",
    "Blend Swap CC-0#relaxChair": "lounger",
    "Blend Swap CC-0#technicalTable2": "drafting_table",
    "Blend Swap CC-0#islandExtension": "kitchen_island",
    "Blend Swap CC-BY#chair_deck": "lounger",
    "Blend Swap CC-BY#chest": "cabinet",
    "Blend Swap CC-BY#kitchenIsland": "cabinet",
    "Kator Legaz#chair-ottoman": "lounger",
    "Scopia#beach_chair": "lounger",
    "Scopia#box_room": "cabinet",
    "Scopia#contemp_living_room": "wall_unit",
    "Scopia#ext_chair": "sofa",
    "Scopia#littlebank": "bench",
    "Scopia#office_box": "cabinet",
    "Scopia#wood_bank": "bench",
}
"""What a person saw on the picture where the title says otherwise."""

_BY_TITLE = (
    ("wheelchair", r"wheelchair"),
    ("lounger", r"lounge\b|hammock"),
    ("game_table", r"pool table|football table|table tennis$|flipper"),
    ("miscellaneous", r"tennis bat|remote control|tablet$"),
    ("changing_table", r"changing table"),
    ("dressing_table", r"dressing table"),
    ("workbench", r"workbench"),
    ("kitchen_island", r"\bisland$"),
    ("sink", r"\bsink\b|washbasin|vanity|lavatory"),
    ("lamp", r"\blamps?\b|\blight|lights\b|lantern|lamppost|spotlight|chandelier|candle|fluorescent"),
    ("fan", r"\bfan$"),
    ("bed", r"\bbed\b|crib|futon$|mattress"),
    ("sofa", r"sofa|couch"),
    ("stool", r"\bpuff\b"),
    (
        "cabinet",
        r"bedside table|nightstand|bookcase|shelves|shelving|cabinet|cupboard|wardrobe|dresser|locker$|tv stand",
    ),
    ("bench", r"\bbench\b"),
    ("chair", r"chair|stool|class seat"),
    ("table", r"\btable\b|\bdesk\b"),
    ("door", r"\bdoors?\b"),
    ("window", r"window|shutter"),
    ("curtain", r"curtain|blind"),
    ("staircase", r"staircase|escalator|ladder"),
    ("toilet", r"toilets? unit|urinal|bidet"),
    ("bathtub", r"\bbath(tub)?$|jacuzzi"),
    ("shower", r"\bshower\b"),
    ("fridge", r"fridge|refrigerator|freezer"),
    ("microwave", r"microwave"),
    ("oven", r"oven$|stove|cooktop|cooker"),
    ("washing_machine", r"washing machine|dryer machine"),
    ("radiator", r"radiator|heater|furnace|chimney|fireplace"),
    ("display", r"\btv\b|imac|ibook|laptop"),
    ("trash_bin", r"trash ?can|dustbin|recycling bin"),
    ("box", r"\bbox\b|crate|trun(c)?k|barrel|\bsafe\b|chest$"),
    ("piano", r"piano$"),
    ("plant", r"plant|tree|bamboo|palm|cactus|orchid|lily|tulip|ficus|yucca|flowers|hedge|bush|pine|maple|acacia"),
    ("vase", r"\bvase\b|pottery"),
    ("bicycle", r"\bbike\b|bicycle|scooter|motor(bike|cycle)"),
)

OURS = ("chair", "table", "cabinet")
"""Categories with bundled networks of their own."""

FURNITURE = (
    *OURS,
    *("sofa", "bed", "bench", "stool", "lounger", "wall_unit", "kitchen_island", "workbench", "game_table"),
    *("changing_table", "dressing_table", "drafting_table", "lamp", "plant", "vase", "box", "trash_bin", "piano"),
    *("door", "window", "curtain", "staircase", "radiator", "toilet", "bathtub", "shower", "sink"),
    *("fridge", "oven", "microwave", "washing_machine", "display", "fan"),
)
"""Furniture and fixtures of rooms: what is scanned as an object and stays where it is."""


def category_of_model(model: LibraryModel) -> str:
    """Name the category of a model; without a telling title, the room that the library puts it in."""
    if model.key in _BY_KEY:
        return _BY_KEY[model.key]
    title = model.title.lower()
    for category, pattern in _BY_TITLE:
        if re.search(pattern, title):
            return category
    return slug(model.room).replace("-", "_") or "other"


def slug(text: str) -> str:
    """Reduce a name to lower-case letters, digits and single hyphens."""
    return re.sub(r"[^a-z0-9]+", "-", text.lower()).strip("-")
