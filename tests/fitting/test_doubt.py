"""What a fit says of scans that no fit can be right for: other things, fragments, two objects; and of good ones."""

import numpy as np
import pytest
import torch

import kpred
from kpred.ops import sample_surface
from kpred.shapes.mesh import Mesh
from kpred.synthetic.generator import generate


def _surface(mesh: Mesh, count: int = 2048) -> np.ndarray:
    vertices, faces = torch.tensor(mesh.vertices).double(), torch.tensor(mesh.faces).long()
    return sample_surface(vertices, faces, count, torch.Generator().manual_seed(0))[0].numpy()


def _doubted(fit: kpred.Fit) -> bool:
    return fit.confidence < 0.5


@pytest.fixture(scope="module")
def furniture() -> list[kpred.Fit]:
    shapes = [mesh for name in ("chair", "table", "cabinet") for mesh in generate(name, 3, seed=41, splits=False)]
    return [kpred.fit(_surface(mesh), up="y") for mesh in shapes]


def test_furniture_is_trusted(furniture: list[kpred.Fit]) -> None:
    assert np.mean([_doubted(fit) for fit in furniture]) <= 0.25
    for fit in furniture:
        assert 0.0 <= fit.confidence <= 1.0
        assert sum(fit.category_confidence.values()) == pytest.approx(1.0)
        assert set(fit.category_confidence) <= {"chair", "table", "cabinet"}


def test_other_things_are_doubted_or_warned_of(furniture: list[kpred.Fit]) -> None:
    fits = [kpred.fit(_surface(mesh), up="y") for mesh in generate("other", 8, seed=8, splits=False)]
    assert np.mean([_doubted(fit) or bool(fit.warnings) for fit in fits]) >= 0.7
    assert np.mean([fit.confidence for fit in fits]) < np.mean([fit.confidence for fit in furniture]) - 0.25
    assert all(fit.warnings for fit in fits if _doubted(fit)), "no doubt without a word"


def test_a_fragment_is_less_certain_than_the_whole() -> None:
    drops = []
    for mesh in generate("chair", 4, seed=41, splits=False):
        whole = _surface(mesh, 6000)
        near = np.linalg.norm(whole - whole[np.argmin(whole[:, 1])], axis=1).argsort()[:300]
        drops.append(kpred.fit(whole, up="y").confidence - kpred.fit(whole[near], up="y").confidence)
    assert np.mean(drops) > 0.3


def test_two_objects_in_one_crop_are_less_certain_than_one() -> None:
    one, other = (_surface(mesh) for mesh in generate("chair", 2, seed=43, splits=False))
    both = np.concatenate([one, other[:, [2, 1, 0]] + [1.1 * np.ptp(one[:, 0]), 0.0, 0.3]])
    single, pair = kpred.fit(one, up="y"), kpred.fit(both, up="y")
    assert pair.confidence < single.confidence - 0.2
    assert pair.warnings
