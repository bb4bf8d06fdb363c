"""A database of many categories: the category of a scan is found, or given, and said with a confidence of its own."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
import torch

from kpred.database import Database, build_database
from kpred.fitting import Fit, fit
from kpred.fitting.stages import Context
from kpred.nn import load_model
from kpred.ops import sample_surface
from kpred.shapes.mesh import Mesh
from kpred.synthetic.generator import generate

CATEGORIES = ("bed", "chair", "lamp", "sofa", "toilet")


@pytest.fixture(scope="module")
def many(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Database]:
    file = tmp_path_factory.mktemp("many") / "many.kpred"
    shapes = [(mesh.name, name, "", mesh) for name in CATEGORIES for mesh in generate(name, 4, 977, splits=False)]
    build_database(file, shapes, load_model())
    with Database.open(file, read_only=True) as database:
        yield database


def scan_of(mesh: Mesh) -> np.ndarray:
    """Sample the whole surface, in metres, somewhere in a room, turned by 70 degrees."""
    vertices, faces = torch.from_numpy(mesh.vertices).double(), torch.from_numpy(mesh.faces).long()
    points = sample_surface(vertices, faces, 3000, torch.Generator().manual_seed(0))[0].numpy()
    c, s = np.cos(1.2), np.sin(1.2)
    return points @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]).T + [3.0, 0.0, -2.0]


@pytest.fixture(scope="module")
def fits(many: Database) -> dict[str, Fit]:
    """Fits of one new shape of each category, and of a person, who is none of them."""
    numbers = {"bed": 1, "chair": 2, "lamp": 0, "sofa": 0, "toilet": 0}
    meshes = {name: generate(name, number + 1, 978, splits=False)[number] for name, number in numbers.items()}
    others = generate("other", 34, 978, splits=False)
    meshes["person"] = next(mesh for mesh in others if mesh.name.startswith("person"))
    return {name: fit(scan_of(mesh), database=many, up="y") for name, mesh in meshes.items()}


def test_the_category_of_a_scan_is_found(fits: dict[str, Fit]) -> None:
    assert {name: found.category for name, found in fits.items() if name != "person"} == {n: n for n in CATEGORIES}


def test_another_thing_has_less_confidence(fits: dict[str, Fit]) -> None:
    confidence = {name: found.confidence for name, found in fits.items()}
    other = confidence.pop("person")
    assert other < 0.3
    assert np.mean(list(confidence.values())) > 0.5


def test_the_recognizer_is_chosen_by_the_categories_of_the_database(many: Database) -> None:
    model = load_model()
    assert model.shared_recognizer is not None
    assert Context.load(model, many, None).recognizer is model.shared_recognizer
    assert Context.load(model, None, None).recognizer is model.recognizer
    assert Context.load(model, many, "sofa").recognizer is model.shared_recognizer
    assert Context.load(model, many, "chair").recognizer is model.recognizer
