"""Furniture made in code, ready to be fitted, and scans of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import torch

from kpred.ops.sampling import sample_surface
from kpred.refinement.structure_config import StructureConfig
from kpred.refinement.structure_fit import Evidence, StructureMap, StructureModel, fit_structure
from kpred.shapes.structure import Structure
from kpred.shapes.structure.analyse import find_structure
from kpred.shapes.structure.cleanliness import Cleanliness, measure_cleanliness
from kpred.synthetic.assembly import assemble
from kpred.synthetic.part import Part
from kpred.synthetic.parts import beam, box, curved_panel, cylinder

Visible = Callable[[np.ndarray], np.ndarray]


def everywhere(places: np.ndarray) -> np.ndarray:
    """All is seen."""
    return np.ones(len(places))


@dataclass(frozen=True, eq=False)
class Case:
    """A model in its unit box, and samples of its surface."""

    vertices: np.ndarray
    faces: np.ndarray
    points: np.ndarray
    normals: np.ndarray
    structure: Structure
    model: StructureModel

    @classmethod
    def of(
        cls, vertices: np.ndarray, faces: np.ndarray, count: int = 2048, config: StructureConfig | None = None
    ) -> Case:
        """Sample and analyse a mesh of the unit box."""
        generator = torch.Generator().manual_seed(0)
        drawn, on = sample_surface(
            torch.from_numpy(vertices).float(), torch.from_numpy(faces.astype(np.int64)), count, generator
        )
        points, on_face = drawn.numpy().astype(np.float64), on.numpy()
        corners = vertices[faces[on_face]]
        cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normals = cross / np.maximum(np.linalg.norm(cross, axis=1, keepdims=True), 1e-30)
        structure = find_structure(vertices, faces, points, on_face)
        parts = structure.vertex_parts[faces[on_face, 0]]
        model = StructureModel.of(structure, points, parts, normals, config or StructureConfig())
        return cls(vertices, faces, points, normals, structure, model)

    def scan(self, vertices: np.ndarray, count: int = 2048, seed: int = 1) -> np.ndarray:
        """Points of the same surface with other vertices, float32."""
        generator = torch.Generator().manual_seed(seed)
        faces = torch.from_numpy(self.faces.astype(np.int64))
        return sample_surface(torch.from_numpy(vertices).float(), faces, count, generator)[0].numpy()

    def fit(
        self,
        goal: np.ndarray,
        visible: Visible = everywhere,
        floor: float | None = None,
        config: StructureConfig | None = None,
        start: np.ndarray | None = None,
    ) -> StructureMap:
        """Fit the model to a scan, from where it is."""
        begun = self.points if start is None else start
        return fit_structure(self.model, begun, Evidence(goal, visible, floor), config or StructureConfig())

    def moved(self, found: StructureMap) -> np.ndarray:
        """The vertices under a map."""
        return found(self.vertices, self.structure.vertex_parts)

    def cleanliness(self, result: np.ndarray) -> Cleanliness:
        return measure_cleanliness(self.vertices, result, self.faces, self.structure)


def in_unit_box(vertices: np.ndarray) -> np.ndarray:
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    scaled: np.ndarray = (vertices - (low + high) / 2) / (high - low).max()
    return scaled


def made(parts: Sequence[Part]) -> Case:
    """A case of labelled parts."""
    mesh = assemble(parts)
    return Case.of(in_unit_box(mesh.vertices.astype(np.float64)), mesh.faces)


def table(width: float = 1.2, height: float = 0.7, depth: float = 0.8, top: float = 0.05) -> list[Part]:
    """A top on four legs, all cuboids."""
    x, z = width / 2 - 0.05, depth / 2 - 0.05
    legs = [box((0.06, height, 0.06), (i * x, height / 2, j * z), "leg") for i in (-1, 1) for j in (-1, 1)]
    return [box((width, top, depth), (0.0, height + top / 2, 0.0), "top"), *legs]


def chair(legs: float = 0.4, seat: float = 0.05, lean: float = 0.0) -> list[Part]:
    """A seat, a back that may lean (degrees), four legs, all cuboids."""
    sticks = [box((0.05, legs, 0.05), (x, legs / 2, z), "leg") for x in (-0.17, 0.17) for z in (-0.17, 0.17)]
    back = box((0.41, 0.5, 0.04), (0.0, legs + seat + 0.25, -0.19), "back")
    back = back.rotated("x", -lean, (0.0, legs + seat, -0.19))
    return [box((0.45, seat, 0.45), (0.0, legs + seat / 2, 0.0), "seat"), back, *sticks]


def splayed_chair() -> list[Part]:
    """A seat, a back that leans and four legs that splay."""
    legs = [
        beam((x * 1.4, 0.0, z * 1.4), (x, 0.42, z), 0.05, 0.05, "leg") for x in (-0.15, 0.15) for z in (-0.15, 0.15)
    ]
    return [*chair(lean=12.0)[:2], *legs]


def round_table() -> list[Part]:
    """A disc on a column on a square foot."""
    return [
        cylinder(0.5, (0.0, 0.7, 0.0), (0.0, 0.74, 0.0), "top", sides=32),
        cylinder(0.06, (0.0, 0.04, 0.0), (0.0, 0.7, 0.0), "column", sides=24),
        box((0.5, 0.04, 0.5), (0.0, 0.02, 0.0), "base"),
    ]


def curved_chair() -> list[Part]:
    """A chair whose back is a curved panel."""
    parts = chair()
    return [parts[0], curved_panel(0.41, 0.5, 0.03, -0.08, 0.0, (0.0, 0.7, -0.15), "back"), *parts[2:]]


def shelf() -> list[Part]:
    """An open bookcase of boards: two sides, a back, three shelves."""
    sides = [box((0.03, 1.4, 0.3), (x, 0.7, 0.0), "side") for x in (-0.385, 0.385)]
    boards = [box((0.74, 0.03, 0.24), (0.0, y, 0.01), "shelf") for y in (0.1, 0.6, 1.2)]
    return [*sides, box((0.74, 1.36, 0.03), (0.0, 0.7, -0.12), "back"), *boards]


FURNITURE: dict[str, Callable[[], list[Part]]] = {
    "table": table,
    "chair": chair,
    "splayed chair": splayed_chair,
    "round table": round_table,
    "curved chair": curved_chair,
    "shelf": shelf,
}


@pytest.fixture(scope="session")
def cases() -> dict[str, Case]:
    """All furniture of this file, by name."""
    return {name: made(parts()) for name, parts in FURNITURE.items()}


@pytest.fixture(params=sorted(FURNITURE))
def case(request: pytest.FixtureRequest, cases: dict[str, Case]) -> Case:
    """One piece of furniture."""
    found: Case = cases[request.param]
    return found


@pytest.fixture(scope="session")
def build() -> Callable[[Sequence[Part]], Case]:
    """From labelled parts to a case."""
    return made


@pytest.fixture(scope="session")
def of_mesh() -> Callable[..., Case]:
    """From vertices and faces of any size to a case."""

    def case(vertices: np.ndarray, faces: np.ndarray, count: int = 2048) -> Case:
        return Case.of(in_unit_box(np.asarray(vertices, np.float64)), faces, count)

    return case


@pytest.fixture(scope="session")
def real() -> dict[str, Case]:
    """One decimated Infinigen shape of each category: curved, many parts, slivers."""
    arrays = np.load(Path(__file__).resolve().parents[1] / "data" / "infinigen.npz")
    return {
        name: Case.of(in_unit_box(arrays[f"{name}_vertices"].astype(np.float64)), arrays[f"{name}_faces"].astype(int))
        for name in ("chair", "table", "cabinet")
    }
