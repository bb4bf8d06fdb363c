"""Baselines: exact nearest shapes, and a deformation that obeys its laws without learning."""

import pytest
import torch
from scipy.spatial import cKDTree

from kpred.evaluation.methods.no_learning import NoLearning
from kpred.evaluation.metrics.cloud_errors import CHUNK, cloud_errors
from kpred.fitting import RefineConfig


def _kd(a: torch.Tensor, b: torch.Tensor) -> float:
    return float((cKDTree(b.numpy()).query(a.numpy())[0] ** 2).mean())


@pytest.mark.parametrize("partial", [False, True])
def test_cloud_errors_agree_with_a_kd_tree(generator: torch.Generator, partial: bool) -> None:
    target = torch.rand(50, 3, generator=generator)
    shapes = torch.rand(CHUNK + 3, 40, 3, generator=generator)
    wanted = [_kd(target, shape) + (0 if partial else _kd(shape, target)) for shape in shapes]
    assert cloud_errors(target, shapes, partial).tolist() == pytest.approx(wanted, rel=1e-4)


@pytest.fixture
def baseline(generator: torch.Generator) -> NoLearning:
    directions = torch.nn.functional.normalize(torch.randn(3, 300, 3, generator=generator), dim=2)
    shapes = directions * torch.tensor([[1.0, 0.5, 0.5], [0.4, 1.0, 0.4], [0.8, 0.8, 1.0]])[:, None]
    return NoLearning.build(("a", "b", "c"), "ball", shapes)


def test_the_basis_moves_rigidly_when_all_keypoints_move_alike(baseline: NoLearning) -> None:
    assert baseline.basis.shape == (3, 300, 12)
    torch.testing.assert_close(baseline.basis.sum(2), torch.ones(3, 300), rtol=0, atol=1e-4)


def test_candidates_start_where_the_shapes_are(baseline: NoLearning) -> None:
    target = baseline.points[1] + 0.01
    distances = cloud_errors(target, baseline.points)
    found = baseline.candidates(target, distances, torch.tensor([1, 0]), partial=False)
    assert found.model_ids == ("b", "a")
    torch.testing.assert_close(found.errors(), distances[[1, 0]])


def test_refinement_brings_the_shape_to_a_stretched_and_moved_target(baseline: NoLearning) -> None:
    target = baseline.points[0] * torch.tensor([1.0, 1.3, 0.9]) + 0.05
    distances = cloud_errors(target, baseline.points)
    found = baseline.candidates(target, distances, torch.tensor([0]), partial=False)
    before, after = float(found.errors()), float(found.refined(RefineConfig()).errors())
    assert after < 0.5 * before


def test_progress_counts_shapes(generator: torch.Generator) -> None:
    shapes = torch.rand(20, 64, 3, generator=generator) * 2 - 1
    told: list[int] = []
    NoLearning.build(tuple("abcdefghijklmnopqrst"), "box", shapes, told.append)
    assert told[-1] == 20
    assert told == sorted(told)
