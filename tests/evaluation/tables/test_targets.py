"""Targets: samples by seed and id, planes that hide what they say, subsets that grow."""

from pathlib import Path

import numpy as np
import pytest
import torch

from kpred.database.encode import prepare_mesh
from kpred.errors import ConfigError, PackError
from kpred.evaluation.tables.targets import make_target, read_targets
from kpred.ops import chamfer_distance
from kpred.shapes.mesh import Mesh
from kpred.shapes.pack import MeshPack


@pytest.fixture
def pack(packs: dict[str, Path]) -> MeshPack:
    return MeshPack.load(packs["chair"])


def test_a_target_depends_on_seed_and_id_alone(pack: MeshPack) -> None:
    first, same = make_target(pack[3], "a", 0), make_target(pack[3], "a", 0)
    assert torch.equal(first.points, same.points)
    assert torch.equal(first.normal, same.normal)
    for other in (make_target(pack[3], "b", 0), make_target(pack[3], "a", 1)):
        assert not torch.equal(first.points, other.points)
        assert not torch.equal(first.normal, other.normal)


def test_a_target_fills_its_unit_box_and_its_samples_are_of_one_surface(pack: MeshPack) -> None:
    target = make_target(pack[3], "a", 0)
    assert target.points.shape == target.again.shape == (2048, 3)
    assert 0.9 < float(target.points.abs().max()) <= 1 + 1e-6
    assert 0 < float(chamfer_distance(target.points[None], target.again[None])) < 0.01


def test_a_target_is_not_the_sample_that_a_database_makes_of_the_same_shape(pack: MeshPack) -> None:
    target, prepared = make_target(pack[3], "a", 0), prepare_mesh(pack[3], "a", 0)
    assert not torch.isclose(target.points, prepared.points).all(1).any()


@pytest.mark.parametrize("occlusion", [0.0, 0.25, 0.5, 0.75])
def test_the_plane_hides_its_share_and_only_one_side(pack: MeshPack, occlusion: float) -> None:
    target = make_target(pack[3], "a", 0)
    seen = target.visible(occlusion)
    assert len(seen) == round((1 - occlusion) * 2048)
    heights = (target.points @ target.normal).sort().values
    assert float((seen @ target.normal).max()) <= float(heights[len(seen) - 1]) + 1e-6


def test_less_occlusion_shows_all_that_more_occlusion_shows(pack: MeshPack) -> None:
    target = make_target(pack[3], "a", 0)
    some, more = target.visible(0.75), target.visible(0.25)
    assert {tuple(p) for p in some.tolist()} < {tuple(p) for p in more.tolist()}


def test_limits_are_nested_and_by_seed(pack: MeshPack) -> None:
    def ids(limit: int | None, seed: int) -> list[str]:
        return [t.model_id for t in read_targets(pack, "p", "source", limit, seed, pytest.fail)]

    everyone = ids(None, 0)
    assert everyone == [str(pack.model_id[i]) for i in pack.indices("source")]
    assert set(ids(2, 0)) < set(ids(5, 0)) < set(everyone)
    assert ids(100, 0) == everyone
    assert len({tuple(ids(3, seed)) for seed in range(5)}) > 1


def test_shapes_without_a_surface_are_left_out_and_told(pack: MeshPack) -> None:
    meshes = list(pack)
    meshes[3] = Mesh(np.zeros_like(meshes[3].vertices), meshes[3].faces)
    broken = MeshPack.from_meshes(meshes, list(pack.model_id), list(pack.split), "chair")
    told: list[str] = []
    targets = read_targets(broken, "p", "val", None, 0, told.append)
    assert len(targets) == len(np.flatnonzero(pack.split == "val")) - 1
    assert len(told) == 1
    assert str(pack.model_id[3]) in told[0]


def test_bad_arguments_are_told(pack: MeshPack) -> None:
    with pytest.raises(PackError, match="split 'test'"):
        read_targets(pack, "p", "test", None, 0, pytest.fail)
    with pytest.raises(ConfigError, match="at least 1"):
        read_targets(pack, "p", "val", 0, 0, pytest.fail)
