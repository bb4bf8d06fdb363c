"""Names of furniture in the data sets that scans come from: ShapeNet synsets, NYU40 classes, free words."""

from __future__ import annotations

from kpred.shapes.folder import CATEGORY_OF

NYU40 = (
    *("unlabelled", "wall", "floor", "cabinet", "bed", "chair", "sofa", "table", "door", "window", "bookshelf"),
    *("picture", "counter", "blinds", "desk", "shelves", "curtain", "dresser", "pillow", "mirror", "floor_mat"),
    *("clothes", "ceiling", "books", "refrigerator", "television", "paper", "towel", "shower_curtain", "box"),
    *("whiteboard", "person", "night_stand", "toilet", "sink", "lamp", "bathtub", "bag", "otherstructure"),
    *("otherfurniture", "otherprop"),
)
"""Class names by the number that ScanNet's `*.labels.ply` carry (0 to 40)."""

STRUCTURE = ("wall", "floor", "ceiling")
"""What stands around objects and belongs to none."""

SYNSETS = {
    "02747177": "trash_bin",
    "02808440": "bathtub",
    "02818832": "bed",
    "02828884": "bench",
    "02871439": "bookshelf",
    "02933112": "cabinet",
    "03001627": "chair",
    "03046257": "clock",
    "03211117": "display",
    "03325088": "faucet",
    "03337140": "file_cabinet",
    "03636649": "lamp",
    "03642806": "laptop",
    "03928116": "piano",
    "03938244": "pillow",
    "03991062": "plant_pot",
    "04004475": "printer",
    "04256520": "sofa",
    "04330267": "stove",
    "04379243": "table",
    "04401088": "telephone",
    "04554684": "washing_machine",
    "02801938": "basket",
    "02773838": "bag",
    "02843684": "birdhouse",
    "02992529": "telephone",
    "03207941": "dishwasher",
    "03761084": "microwave",
    "02876657": "bottle",
}
"""ShapeNet's category ids in Scan2CAD, with their names."""

_WORDS = {
    **{"armchair": "chair", "couch": "sofa", "tv": "display", "monitor": "display", "television": "display"},
    **{"shelf": "cabinet", "shelves": "cabinet", "bookshelves": "cabinet", "wardrobe": "cabinet"},
    **{"dresser": "cabinet", "cupboard": "cabinet", "nightstand": "cabinet", "night_stand": "cabinet"},
    **{"file_cabinet": "cabinet", "storage": "cabinet", "trash_can": "trash_bin", "trashcan": "trash_bin"},
    **{"trashbin": "trash_bin", "recycling_bin": "trash_bin", "bin": "trash_bin"},
    **{"refrigerator": "fridge", "stove": "oven", "cooker": "oven", "washbasin": "sink"},
    **{"plant_pot": "plant", "potted_plant": "plant", "ottoman": "stool", "pouf": "stool"},
}

_NYU40_OF = {
    "chair": ("chair",),
    "table": ("table", "desk"),
    "cabinet": ("cabinet", "bookshelf", "shelves", "dresser", "night_stand"),
    "trash_bin": ("otherfurniture", "otherprop"),
    "sofa": ("sofa",),
    "bed": ("bed",),
    "bathtub": ("bathtub",),
    "display": ("television", "otherprop"),
    "lamp": ("lamp",),
    "pillow": ("pillow",),
}

_SYNSET_OF = {"chair": "03001627", "table": "04379243", "cabinet": "02933112"}


def category_of(name: str) -> str:
    """Map a synset, a class name or a label to a category: `office chair` and `03001627` are `chair`.

    Storage furniture is one category, `cabinet`. A name that means nothing known comes back in lower case with
    underscores.
    """
    lower = "_".join(name.strip().lower().replace("-", "_").split())
    if lower in SYNSETS:
        lower = SYNSETS[lower]
    last = lower.rpartition("_")[2]
    for word in (lower, lower.removesuffix("s"), last, last.removesuffix("s")):
        if word in CATEGORY_OF:
            return CATEGORY_OF[word]
        if word in _WORDS:
            return _WORDS[word]
        if word in _SYNSET_OF or word in _NYU40_OF:
            return word
    return lower


def nyu40_numbers(category: str) -> tuple[int, ...]:
    """Return the NYU40 numbers of a category; empty when it has none."""
    return tuple(NYU40.index(name) for name in _NYU40_OF.get(category, ()))


def synset_of(category: str) -> str:
    """Return ShapeNet's id of a category, or the category itself where it has none."""
    known = {name: synset for synset, name in SYNSETS.items()} | _SYNSET_OF
    return known.get(category, category)
