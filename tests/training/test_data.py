"""Training data: the constants of each source, and fresh targets that are still the same shapes."""

import dataclasses

import numpy as np
import pytest
import torch

from kpred.errors import PackError
from kpred.ops import icosphere, mean_value_coordinates, nearest_neighbours
from kpred.shapes.mesh import Mesh
from kpred.shapes.pack import MeshPack
from kpred.training.augmentation import random_factors, to_unit_box
from kpred.training.data import POOL_POINTS, TrainingData, prepare
from kpred.training.run import new_network


def test_sizes(data: TrainingData, train_config) -> None:
    assert data.pool.shape == (4, POOL_POINTS, 3)
    assert data.points.shape == (4, train_config.points, 3)
    assert data.cages.shape == (4, 42, 3)
    assert data.weights.shape == (4, train_config.points, 42)
    assert data.weights.dtype == torch.float16


def test_shapes_fill_their_unit_boxes(data: TrainingData) -> None:
    assert data.pool.abs().amax() <= 1 + 1e-6
    assert (data.pool.abs().amax((1, 2)) > 0.97).all()


def test_cached_constants_are_those_computed_anew(data: TrainingData) -> None:
    weights = mean_value_coordinates(data.points, data.cages, icosphere(1)[1])
    torch.testing.assert_close(data.weights.float(), weights, rtol=1e-3, atol=1e-3)
    torch.testing.assert_close(data.weights.float() @ data.cages, data.points, rtol=0, atol=5e-3)


def test_the_same_seed_gives_the_same_data(pack, data, model_config, train_config) -> None:
    network = new_network(model_config, 5)
    again = prepare([pack], network, train_config.points, seed=0)
    other = prepare([pack], network, train_config.points, seed=1)
    for field in dataclasses.fields(TrainingData):
        one, two = getattr(again, field.name), getattr(data, field.name)
        assert torch.equal(one, two) if isinstance(one, torch.Tensor) else one == two, field.name
    assert not torch.equal(other.pool, data.pool)


def test_first_pool_points_are_a_fair_sample(data: TrainingData) -> None:
    for cloud in data.pool.float():
        # The mean of 512 points lies within 5 standard errors of the mean of all.
        error = (cloud[:512].mean(0) - cloud.mean(0)).abs()
        assert (error < 5 * cloud.std(0) / 512**0.5).all()


def test_targets_are_whole_shapes_in_their_boxes(data: TrainingData) -> None:
    targets = data.draw_targets(6, 300, 1.3, torch.Generator().manual_seed(0))
    assert targets.shape == (6, 300, 3)
    torch.testing.assert_close(targets.abs().amax((1, 2)), torch.ones(6))
    torch.testing.assert_close(targets, to_unit_box(targets))
    plain = data.draw_targets(6, 300, 1.0, torch.Generator().manual_seed(0))
    # Unstretched, every target's points are points of one shape of the pool.
    for target in plain:
        assert min(float(nearest_neighbours(target[None], cloud[None])[0].max()) for cloud in data.pool.float()) == 0
        assert len(target.unique(dim=0)) == 300


def test_a_scanned_target_shows_the_target_itself(data: TrainingData) -> None:
    whole, seen = data.draw_scanned_targets(6, 4096, 1.3, torch.Generator().manual_seed(0))
    gap = torch.cdist(seen, whole).amin(2)
    assert gap.mean() < 0.03, "the scan does not lie on its target"
    crossed = torch.cdist(seen, whole.roll(1, 0)).amin(2)
    assert crossed.mean() > 2 * gap.mean()


def test_factors_are_bounded_and_mirror_left_to_right_alone() -> None:
    factors = random_factors(2000, 1.3, torch.Generator().manual_seed(0))[:, 0]
    assert factors.abs().min() >= 1 / 1.3 - 1e-6
    assert factors.abs().max() <= 1.3 + 1e-6
    assert factors[:, 0].sign().mean().abs() < 0.1
    assert (factors[:, 1:] > 0).all()
    assert factors.abs().log().mean().abs() < 0.02


def _box(size: float) -> Mesh:
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=np.float32) * size
    faces = [[0, 1, 3], [0, 3, 2], [4, 7, 5], [4, 6, 7], [0, 5, 1], [0, 4, 5], [2, 3, 7], [2, 7, 6]]
    return Mesh(corners, np.array(faces, dtype=np.int32))


def _pack(meshes: list[Mesh], splits: list[str]) -> MeshPack:
    return MeshPack.from_meshes(meshes, [f"m{i}" for i in range(len(meshes))], splits, "box")


def test_splits_and_unusable_shapes(model_config) -> None:
    network = new_network(model_config, 0)
    line = np.array([[0, 0, 0], [1, 1, 1], [2, 2, 2]], dtype=np.float32)
    flat = Mesh(line, np.array([[0, 1, 2]], dtype=np.int32))  # has size, but no area
    point = Mesh(np.ones((3, 3), dtype=np.float32), np.array([[0, 1, 2]], dtype=np.int32))  # has neither
    meshes = [_box(1), flat, _box(2), point, _box(3), _box(4)]
    pack = _pack(meshes, ["source", "source", "train", "train", "val", "source"])
    data = prepare([pack], network, 64, 0)
    assert (len(data.targets), len(data.sources)) == (3, 3)
    only = prepare([pack], network, 64, 0, source_split="source")
    assert (len(only.targets), only.sources.tolist()) == (3, [0, 2])
    with pytest.raises(PackError, match="fewer than two"):
        prepare([_pack(meshes, ["val", "source", "val", "source", "val", "train"])], network, 64, 0)


def _mixed(model_config) -> TrainingData:
    """Three boxes, then two chests, then one more box: numbers 0, 0, 0, 1, 1, 0."""
    network = new_network(model_config, 0)
    boxes = [_box(size) for size in (1, 2, 3, 4, 5, 6)]
    chests = MeshPack.from_meshes(boxes[3:5], ["c0", "c1"], ["source", "train"], "chest")
    packs = [_pack(boxes[:3], ["source"] * 3), chests, _pack(boxes[5:], ["source"])]
    return prepare(packs, network, 64, 0)


def test_categories_share_their_shapes_with_no_other(model_config) -> None:
    data = _mixed(model_config)
    assert data.categories is not None and data.categories.tolist() == [0, 0, 0, 1, 1, 0]
    generator = torch.Generator().manual_seed(0)
    wanted = data.draw_categories(64, generator, alike=4)
    assert wanted is not None and set(wanted.tolist()) == {0, 1}
    assert all(len(set(run.tolist())) == 1 for run in wanted.split(4))
    rows = data.draw_sources(64, generator, wanted)
    assert torch.equal(data.categories[data.sources[rows]], wanted)
    assert set(rows.tolist()) == set(range(6))
    targets = data.draw_targets(64, 200, 1.0, generator, wanted)
    distances = torch.stack(
        [nearest_neighbours(targets, shape.float().expand(64, -1, -1))[0].mean(1) for shape in data.pool]
    )
    assert torch.equal(data.categories[distances.argmin(0)], wanted)


def test_one_category_needs_no_numbers(data: TrainingData) -> None:
    assert data.categories is None
    assert data.draw_categories(8, torch.Generator()) is None


def test_a_category_without_a_source_is_named(model_config) -> None:
    chests = MeshPack.from_meshes([_box(1), _box(2)], ["c0", "c1"], ["train", "train"], "chest")
    with pytest.raises(PackError, match="chest"):
        prepare(
            [_pack([_box(1), _box(2)], ["source"] * 2), chests],
            new_network(model_config, 0),
            64,
            0,
            source_split="source",
        )
