"""The visibility network: what its predictions do not depend on, its grid, and that it comes back from its folder."""

import json
from pathlib import Path

import pytest
import torch

from kpred.errors import ConfigError, ModelError
from kpred.nn import (
    VisibilityConfig,
    VisibilityNetwork,
    load_model,
    load_visibility,
    save_network,
    save_visibility,
)
from kpred.nn.loading import bundled_model_path
from kpred.nn.visibility import QUERY_RANGE, SCAN_POINTS, robust_box
from kpred.ops.sampling import sample_surface
from kpred.ops.trilinear import interpolate_grid
from kpred.synthetic.generator import generate

CONFIG = VisibilityConfig(width=16, blocks=1)
LOW, HIGH = torch.tensor([-1.0, -2.0, 0.0]), torch.tensor([1.0, 0.5, 3.0])


@pytest.fixture
def network(seed: int) -> VisibilityNetwork:
    network = VisibilityNetwork(CONFIG)
    for parameter in network.parameters():
        parameter.data += 0.05 * torch.randn_like(parameter)
    return network.eval().requires_grad_(False)


@pytest.fixture
def queries(generator: torch.Generator) -> torch.Tensor:
    return 4 * torch.rand(3, 50, 3, generator=generator) - 2


def test_predictions_differ_between_places_and_scans(
    network: VisibilityNetwork, clouds: torch.Tensor, queries: torch.Tensor
) -> None:
    logits = network(clouds, queries)
    assert logits.shape == (3, 50) and (logits.std(1) > 1e-3).all()
    assert not torch.allclose(network(clouds[:1], queries[:1]), network(clouds[1:2], queries[:1]), atol=1e-3)


def test_predictions_do_not_depend_on_the_order_of_points(
    network: VisibilityNetwork, clouds: torch.Tensor, queries: torch.Tensor
) -> None:
    order = torch.randperm(clouds.shape[1])
    torch.testing.assert_close(network(clouds[:, order], queries), network(clouds, queries), rtol=0, atol=1e-5)


def test_queries_do_not_influence_each_other(
    network: VisibilityNetwork, clouds: torch.Tensor, queries: torch.Tensor
) -> None:
    torch.testing.assert_close(network(clouds, queries[:, 7:12]), network(clouds, queries)[:, 7:12], rtol=0, atol=1e-5)


@pytest.mark.parametrize(("scale", "shift"), [(1000.0, 0.0), (0.01, 0.0), (1.0, 5.0), (20.0, -30.0)])
def test_scan_and_queries_may_be_moved_and_scaled_together(
    network: VisibilityNetwork, clouds: torch.Tensor, queries: torch.Tensor, scale: float, shift: float
) -> None:
    moved = network(clouds * scale + shift, queries * scale + shift)
    torch.testing.assert_close(moved, network(clouds, queries), rtol=0, atol=2e-3)


def test_far_queries_stay_in_range(network: VisibilityNetwork, clouds: torch.Tensor) -> None:
    middle, half = robust_box(clouds)
    direction = torch.tensor([[[1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]])
    near, far = (network(clouds, middle + half * direction * reach) for reach in (QUERY_RANGE, 1e6))
    torch.testing.assert_close(near, far, rtol=0, atol=1e-4)


def test_grid_agrees_with_queries_at_its_nodes(network: VisibilityNetwork, clouds: torch.Tensor) -> None:
    grid = network.grid(clouds[0], 4, LOW, HIGH)
    for node in ((0, 0, 0), (3, 0, 1), (1, 3, 2), (3, 3, 3)):
        place = LOW + (HIGH - LOW) * torch.tensor(node) / 3
        expected = torch.sigmoid(network(clouds[:1], place[None, None]))[0, 0]
        assert float(grid[node]) == pytest.approx(float(expected), abs=1e-5)
        interpolated = interpolate_grid(grid.numpy(), LOW.numpy(), HIGH.numpy(), place[None].numpy())
        assert float(interpolated[0]) == pytest.approx(float(expected), abs=1e-5)


def test_a_grid_uses_points_at_even_steps_of_many(network: VisibilityNetwork, generator: torch.Generator) -> None:
    many = torch.randn(3 * SCAN_POINTS, 3, generator=generator)
    torch.testing.assert_close(network.grid(many, 3, LOW, HIGH), network.grid(many[::3], 3, LOW, HIGH))


def test_a_few_strays_do_not_move_the_box(clouds: torch.Tensor) -> None:
    middle, half = robust_box(clouds)
    strays = clouds.clone()
    strays[:, :4] = 50.0
    other_middle, other_half = robust_box(strays)
    assert ((other_middle - middle).abs() < 0.15 * half).all() and (other_half < 1.15 * half).all()


def test_points_at_one_place_have_finite_predictions(network: VisibilityNetwork) -> None:
    assert network(torch.ones(1, 70, 3), torch.zeros(1, 2, 3)).isfinite().all()


def test_config_round_trip_and_refusals() -> None:
    assert VisibilityConfig.from_dict(json.loads(json.dumps(CONFIG.to_dict()))) == CONFIG
    for broken in ({"no_such": 1}, {"width": 0}, {"blocks": -1}, {"width": "wide"}):
        with pytest.raises(ConfigError):
            VisibilityConfig.from_dict({**CONFIG.to_dict(), **broken})


def test_it_comes_back_from_beside_the_categories(
    network: VisibilityNetwork, clouds: torch.Tensor, queries: torch.Tensor, tmp_path: Path, small
) -> None:
    save_network(small(category="chair"), tmp_path / "chair")
    assert load_model(tmp_path).visibility is None
    save_visibility(network, tmp_path / "visibility")
    model = load_model(tmp_path)
    assert model.categories == ("chair",) and model.visibility is not None
    assert model.visibility.config == CONFIG
    # Weights are kept in half precision.
    torch.testing.assert_close(model.visibility(clouds, queries), network(clouds, queries), rtol=0, atol=0.02)


def test_a_damaged_folder_is_named(network: VisibilityNetwork, tmp_path: Path) -> None:
    save_visibility(network, tmp_path)
    weights = tmp_path / "model.safetensors"
    weights.write_bytes(weights.read_bytes()[:200])
    with pytest.raises(ModelError, match=r"model\.safetensors"):
        load_visibility(tmp_path)


def test_bundled_weights_know_a_whole_table_from_half_of_one() -> None:
    network = load_model().visibility
    assert network is not None
    assert sum(file.stat().st_size for file in (bundled_model_path() / "visibility").iterdir()) < 1_000_000
    mesh = generate("table", 1, seed=77, splits=False)[0]
    corners, faces = torch.from_numpy(mesh.vertices), torch.from_numpy(mesh.faces).long()
    surface = sample_surface(corners, faces, 4096, torch.Generator().manual_seed(0))[0]
    places, whole = surface[None, :500], surface[None, 500:1012]
    assert torch.sigmoid(network(whole, places)).mean() > 0.9
    kept = surface[:, 0] < surface[:, 0].median()
    seen = torch.sigmoid(network(surface[kept][None, -512:], places))[0]
    assert seen[kept[:500]].mean() - seen[~kept[:500]].mean() > 0.5
