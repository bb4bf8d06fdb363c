"""Training on crops of scanned rooms: frames, segmentation faults, shares of a batch, exact resume with crops."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest
import torch

from kpred.errors import ConfigError, PackError
from kpred.nn import Recognizer, RecognizerConfig
from kpred.nn.visibility import VisibilityConfig
from kpred.shapes.pack import MeshPack
from kpred.synthetic.generator import generate
from kpred.synthetic.rooms.generate import generate_rooms
from kpred.synthetic.rooms.pack import RoomPack
from kpred.training.config import StageConfig
from kpred.training.recognition import RecognitionStage, train_recognizer
from kpred.training.recognition_config import RecognitionConfig
from kpred.training.recognition_data import prepare_recognition
from kpred.training.room_crops import NEAR_POINTS, OWN_POINTS, RoomCrops, prepare_crops, segmented
from kpred.training.visibility import draw_batch, train_visibility
from kpred.training.visibility_config import VisibilityTraining
from kpred.training.visibility_crops import draw_crop_scans, grid_lookup
from kpred.training.visibility_data import prepare_visibility

NAMES = ("cabinet", "chair", "table")
CONFIG = RecognitionConfig(optimisation=StageConfig(steps=3, batch=16), points=64, checkpoint_every=2)
VISIBILITY = VisibilityTraining(
    optimisation=StageConfig(steps=3, batch=8), points=128, min_points=64, queries=60, checkpoint_every=2
)


@pytest.fixture(scope="module")
def rooms() -> RoomPack:
    return generate_rooms(2, 8, scanner="mesh", points=20_000)


@pytest.fixture(scope="module")
def crops(rooms: RoomPack) -> RoomCrops:
    return prepare_crops([rooms], NAMES, 0)


@pytest.fixture(scope="module")
def packs() -> list[MeshPack]:
    return [generate(name, 3, seed=3, splits=False) for name in (*NAMES, "other")]


def test_crops_lie_in_their_objects_boxes(crops: RoomCrops) -> None:
    assert set(crops.category.tolist()) == {0, 1, 2, 3}
    assert crops.own.shape[1:] == (OWN_POINTS, 3)
    assert crops.near.shape[1:] == (NEAR_POINTS, 3)
    # A scanned point lies off its surface by a few centimetres, and the whole object's box holds its surface.
    assert (crops.own.float().abs().amax(2) < 1.15).float().mean() > 0.98
    assert torch.allclose(crops.surface.float().abs().amax((1, 2)), torch.ones(len(crops.own)), atol=0.08)


def test_crops_stand_as_their_surfaces_do(crops: RoomCrops) -> None:
    for row in range(len(crops.own)):
        distance = torch.cdist(crops.own[row].float(), crops.surface[row].float()).amin(1)
        assert distance.median() < 0.12


def test_other_things_have_no_front(crops: RoomCrops) -> None:
    assert (crops.period[crops.category == 3] == 0).all()
    assert (crops.period[crops.category < 3] > 0).any()


def test_other_things_are_drawn_by_their_fraction(crops: RoomCrops, generator: torch.Generator) -> None:
    drawn = crops.category[crops.draw(4000, 0.4, generator)]
    fractions = torch.bincount(drawn, minlength=4) / 4000
    assert fractions[3] == pytest.approx(0.4, abs=0.04)
    numbers = torch.bincount(crops.category)[:3].sqrt()
    assert torch.allclose(fractions[:3], 0.6 * numbers / numbers.sum(), atol=0.04)


def test_crops_of_other_things_are_of_their_own_categories(rooms: RoomPack) -> None:
    narrow, wide = prepare_crops([rooms], NAMES, 0), prepare_crops([rooms], (*NAMES, "lamp", "plant", "sofa"), 0)
    assert len(wide.category) == len(narrow.category)
    assert (narrow.category < 3).sum() == (wide.category < 3).sum()
    assert wide.numbers()["other"] < narrow.numbers()["other"]


def test_without_faults_a_crop_is_its_object(crops: RoomCrops, generator: torch.Generator) -> None:
    rows = torch.arange(len(crops.own))
    clouds = segmented(crops, rows, 64, generator, strength=0.0)
    nearest = torch.cdist(clouds, crops.own.float()).amin(2)
    assert nearest.max() == pytest.approx(0.0, abs=1e-3)


def test_every_point_is_drawn_once_where_there_are_enough(crops: RoomCrops, generator: torch.Generator) -> None:
    rows = (crops.own_count >= 150).nonzero()[:, 0]
    for cloud in segmented(crops, rows, 64, generator):
        assert len(torch.unique(cloud, dim=0)) > 60


def test_faults_add_up_to_15_percent_and_remove_pieces(crops: RoomCrops, generator: torch.Generator) -> None:
    rows = torch.arange(len(crops.own)).repeat(8)
    clouds = segmented(crops, rows, 256, generator)
    foreign = (torch.cdist(clouds, crops.own[rows].float()).amin(2) > 1e-3).float().mean(1)
    assert foreign.max() < 0.25
    assert 0.2 < (foreign > 0).float().mean() < 0.95
    missing = (torch.cdist(crops.own[rows].float(), clouds).amin(2) > 0.3).float().mean(1)
    assert missing.max() > 0.2


def test_a_batch_holds_crops_by_their_fraction(
    crops: RoomCrops, packs: list[MeshPack], generator: torch.Generator
) -> None:
    data = prepare_recognition(packs, 0)
    only = dataclasses.replace(
        crops, category=torch.full_like(crops.category, 3), period=torch.zeros_like(crops.period)
    )
    config = dataclasses.replace(CONFIG, rooms=0.25, others=0.0, right=1.0, quarter=0.0, tilted=0.0)
    network = Recognizer(RecognizerConfig(NAMES, width=16, blocks=1))
    clouds, answer, _, teaches = RecognitionStage(network, data, config, only).batch(generator)
    assert clouds.shape == (16, 64, 3)
    # The last quarter are crops, all of other things here, whose turn is not taught.
    assert (answer[12:] == 3).all()
    assert not teaches[12:].any()
    assert (answer[:12] != 3).any()


def test_sofas_are_other_things() -> None:
    chairs = generate("chair", 41, seed=1, splits=False)
    data = prepare_recognition([chairs, generate("table", 2, seed=1, splits=False)], 0)
    sofas = sum(name in ("sofa_two", "sofa_three", "chaise") for name in chairs.extra["factory"])
    assert sofas == 3
    assert int((data.category == 2).sum()) == sofas


def test_seen_places_of_crops_are_where_points_are(crops: RoomCrops, generator: torch.Generator) -> None:
    config = dataclasses.replace(VISIBILITY, noise=0.0, outliers=0.0, stretch=1.0)
    found = draw_crop_scans(crops, 64, 128, config, generator)
    assert found.scans.shape == (64, 128, 3)
    assert found.places.shape == (64, 60, 3)
    own, seen = found.places[:, :20], found.seen[:, :20]
    near = torch.cdist(own, found.scans).amin(2)
    assert near[seen].mean() < near[~seen].mean()
    assert 0.1 < found.seen.float().mean() < 0.95


def test_a_grid_is_read_at_its_nodes(crops: RoomCrops) -> None:
    grid = torch.zeros_like(crops.grid[:1])
    grid[0, -1, 0, 12] = True
    corner = torch.tensor([[[1.25, -1.25, 0.05], [1.25, -1.25, -1.0], [-1.25, -1.25, 0.05], [9.0, -9.0, 0.05]]])
    assert grid_lookup(grid, corner).tolist() == [[True, False, False, True]]


def test_visibility_batches_hold_crops_last(
    crops: RoomCrops, packs: list[MeshPack], generator: torch.Generator
) -> None:
    data = prepare_visibility(packs[:3], 0)
    batch = draw_batch(data, VISIBILITY, generator, crops)
    assert batch.scans.shape[0] == batch.places.shape[0] == batch.labels.shape[0] == 8
    assert (batch.kind[4:] == 4).all()
    assert (batch.kind[:4] < 4).all()


def test_training_with_rooms_leaves_a_record_and_can_be_refined(
    rooms: RoomPack, packs: list[MeshPack], tmp_path: Path
) -> None:
    small = RecognizerConfig(width=16, blocks=1)
    train_recognizer(packs, CONFIG, tmp_path / "recognizer", model=small, rooms=[rooms])
    assert '"crops"' in (tmp_path / "recognizer" / "model" / "training.json").read_text()
    tiny = VisibilityConfig(width=16)
    first = train_visibility(packs[:3], VISIBILITY, tmp_path / "one", model=tiny, rooms=[rooms])
    still = dataclasses.replace(VISIBILITY, optimisation=StageConfig(steps=1, batch=8, learning_rate=1e-12))
    start = tmp_path / "one" / "model"
    later = train_visibility(packs[:3], still, tmp_path / "two", rooms=[rooms], start_from=start)
    for name, value in first.state_dict().items():
        assert torch.allclose(later.state_dict()[name], value, atol=2e-3), name
    with pytest.raises(ConfigError, match="another kind"):
        train_visibility(packs[:3], still, tmp_path / "x", model=VisibilityConfig(width=8), start_from=start)


def test_rooms_without_any_of_the_categories_are_refused(rooms: RoomPack) -> None:
    with pytest.raises(PackError, match="no crop of toaster"):
        prepare_crops([rooms], ("toaster",), 0)
