"""Training of the visibility network: what its labels say, how scans are drawn, exact resume, its record."""

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import torch

from kpred.errors import ConfigError, PackError
from kpred.nn import VisibilityConfig, load_visibility
from kpred.shapes.pack import MeshPack
from kpred.synthetic.generator import generate
from kpred.training.config import StageConfig
from kpred.training.visibility import draw_batch, train_visibility
from kpred.training.visibility_config import VisibilityTraining
from kpred.training.visibility_data import VisibilityData, prepare_visibility
from kpred.training.visibility_scans import draw_kinds, draw_visible, random_cameras, sample_scans

SMALL = VisibilityConfig(width=16, blocks=1)
CONFIG = VisibilityTraining(
    optimisation=StageConfig(steps=5, batch=8), points=96, min_points=64, queries=30, checkpoint_every=2
)
CLEAN = dataclasses.replace(CONFIG, noise=0.0, outliers=0.0, density=0.0)


@pytest.fixture(scope="module")
def packs() -> list[MeshPack]:
    return [generate(name, 3, seed=3, splits=False) for name in ("table", "chair")]


@pytest.fixture(scope="module")
def data(packs: list[MeshPack]) -> VisibilityData:
    return prepare_visibility(packs, 0)


@pytest.fixture
def ball(generator: torch.Generator) -> torch.Tensor:
    """Surfaces of two unit spheres with a small sphere inside each."""
    points = torch.nn.functional.normalize(torch.randn(2, 16000, 3, generator=generator), dim=2)
    points[:, ::4] *= 0.4
    return points


def test_a_shape_is_drawn_with_another_of_its_category(data: VisibilityData, generator: torch.Generator) -> None:
    assert data.categories == ("chair", "table") and data.clouds.abs().max() <= 1.001
    lopsided = dataclasses.replace(data, category=torch.tensor([0, 0, 1, 1, 1, 1]))
    rows, others = lopsided.draw(4000, generator)
    assert (rows != others).all()
    assert torch.equal(lopsided.category[rows], lopsided.category[others])
    assert float(lopsided.category[rows].float().mean()) == pytest.approx(0.5, abs=0.04)
    assert set(others.tolist()) == set(range(6))


def test_kinds_are_drawn_by_their_fractions(generator: torch.Generator) -> None:
    config = dataclasses.replace(CONFIG, whole=0.4, sliced=0.3, viewed=0.2)
    found = torch.bincount(draw_kinds(config, 4000, generator), minlength=4) / 4000
    assert torch.allclose(found, torch.tensor([0.4, 0.3, 0.2, 0.1]), atol=0.04)


def test_a_whole_scan_sees_everything(ball: torch.Tensor, generator: torch.Generator) -> None:
    visible = draw_visible(ball, ball, ball[:, :500], torch.zeros(2, dtype=torch.long), CONFIG, generator)
    assert visible.candidates.all() and visible.places.all()


def test_a_plane_hides_its_fraction_and_one_half_space(ball: torch.Tensor, generator: torch.Generator) -> None:
    config = dataclasses.replace(CONFIG, hidden=(0.3, 0.3))
    places = 3 * torch.randn(2, 500, 3, generator=generator)
    visible = draw_visible(ball, ball, places, torch.ones(2, dtype=torch.long), config, generator)
    assert torch.allclose(visible.candidates.float().mean(1), torch.full((2,), 0.7), atol=1e-3)
    for cloud, seen, place, place_seen in zip(ball, visible.candidates, places, visible.places, strict=True):
        normal = torch.nn.functional.normalize(cloud[seen].mean(0) - cloud[~seen].mean(0), dim=0)
        level = ((cloud[seen] @ normal).min() + (cloud[~seen] @ normal).max()) / 2
        # The normal is that of the plane up to the sampling of the cloud.
        clear = (place @ normal - level).abs() > 0.2
        assert torch.equal(place_seen[clear], (place @ normal > level)[clear])


def test_one_view_hides_the_inside_and_the_far_side(ball: torch.Tensor, generator: torch.Generator) -> None:
    places = torch.cat([0.5 * ball[:, 1:1000:4], 3.0 * ball[:, 1:1000:4]], dim=1)
    kind = torch.full((2,), 2)
    visible = draw_visible(ball, ball, places, kind, CONFIG, generator)
    inside, outside = visible.places.chunk(2, dim=1)
    assert inside.float().mean() < 0.01
    # Seen from outside: all but the shadow behind the sphere.
    assert (outside.float().mean(1) > 0.7).all() and (outside.float().mean(1) < 1.0).all()
    assert visible.candidates[:, ::4].float().mean() < 0.01
    assert ((visible.candidates[:, 1::4].float().mean(1) - 0.4).abs() < 0.2).all()


def test_merged_views_see_more_than_one(ball: torch.Tensor, generator: torch.Generator) -> None:
    config = dataclasses.replace(CONFIG, max_views=12)
    many = ball[:1].expand(24, -1, -1)
    one, merged = (
        draw_visible(many, many, many[:, :500], torch.full((24,), kind), config, generator)
        .candidates[:, 1::4]
        .float()
        .mean()
        for kind in (2, 3)
    )
    assert merged > one + 0.15


def test_cameras_are_outside_and_not_far_below(generator: torch.Generator) -> None:
    cameras = random_cameras(torch.tensor([1, 5, 300]), generator)
    distance = cameras.norm(dim=1)
    assert len(cameras) == 306 and distance.min() >= 2.5 and distance.max() <= 5.5
    assert (cameras[:, 1] / distance).min() >= -0.1


def test_scans_are_visible_points_that_repeat_only_if_few_are_seen(
    ball: torch.Tensor, generator: torch.Generator
) -> None:
    visible = torch.zeros(ball.shape[:2], dtype=torch.bool)
    visible[0, 100:130] = True
    visible[1, 200:600] = True
    scans = sample_scans(ball, visible, 64, CLEAN, generator)
    for row, (scan, number) in enumerate(zip(scans, (30, 64), strict=True)):
        allowed = {tuple(point) for point in ball[row][visible[row]].tolist()}
        found = {tuple(point) for point in scan.tolist()}
        assert found <= allowed and len(found) == number


def test_density_makes_sampling_uneven(ball: torch.Tensor, generator: torch.Generator) -> None:
    many = ball[:1, 1::4].expand(16, -1, -1)
    seen = torch.ones(many.shape[:2], dtype=torch.bool)
    offsets = []
    for density in (0.0, 3.0):
        config = dataclasses.replace(CLEAN, density=density)
        offsets.append(sample_scans(many, seen, 1000, config, generator).mean(1).norm(dim=1).mean())
    assert offsets[1] > 3 * offsets[0]


def test_labels_of_a_batch_belong_to_its_scans(data: VisibilityData, generator: torch.Generator) -> None:
    config = dataclasses.replace(CLEAN, optimisation=StageConfig(steps=1, batch=64), queries=300, misplaced=0.0)
    batch = draw_batch(data, config, generator)
    assert batch.scans.shape[0] == 64 and 64 <= batch.scans.shape[1] <= 96 and batch.places.shape == (64, 300, 3)
    assert batch.labels[batch.kind == 0].all()
    assert 0.2 < batch.labels[batch.kind == 1].mean() < 0.8
    # Own surface that is seen is near the scan, more than what is hidden.
    own, label = batch.places[:, :100], batch.labels[:, :100].bool()
    near = torch.cdist(own, batch.scans).amin(2)
    cut = batch.kind == 1
    assert near[cut][label[cut]].mean() < 0.5 * near[cut][~label[cut]].mean()


def test_resumed_equals_uninterrupted(packs: list[MeshPack], resume: Callable[..., None]) -> None:
    def train(config: Any, folder: Path, **options: Any) -> torch.nn.Module:
        return train_visibility(packs, config, folder, model=SMALL, **options)

    resume(train, CONFIG)


def test_weights_and_record_lie_in_the_model_folder(packs: list[MeshPack], tmp_path: Path) -> None:
    network = train_visibility(packs, CONFIG, tmp_path, model=SMALL)
    assert load_visibility(tmp_path / "model").config == network.config
    record = json.loads((tmp_path / "model" / "training.json").read_text())
    assert record["shapes"] == {"chair": 3, "table": 3}


def test_it_learns_which_places_are_seen(packs: list[MeshPack], tmp_path: Path) -> None:
    losses: list[float] = []
    stage = StageConfig(steps=60, batch=16, learning_rate=3e-3)
    config = dataclasses.replace(CONFIG, optimisation=stage, whole=0.0, sliced=1.0, viewed=0.0, queries=60)
    train_visibility(packs, config, tmp_path, report=lambda *facts: losses.append(facts[3]["visibility"]), model=SMALL)
    assert sum(losses[-10:]) < 0.9 * sum(losses[:10])


def test_impossible_settings_and_packs_are_refused(packs: list[MeshPack], tmp_path: Path) -> None:
    for broken in (
        {"whole": 0.8, "sliced": 0.4},
        {"viewed": -0.1},
        {"min_points": 8},
        {"points": 100, "min_points": 200},
        {"max_views": 1},
        {"hidden": (0.5, 1.0)},
    ):
        with pytest.raises(ConfigError):
            VisibilityTraining(**broken)
    alone = generate("table", 1, seed=3, splits=False)
    with pytest.raises(PackError, match="Too few"):
        train_visibility([packs[1], alone], CONFIG, tmp_path, model=SMALL)
