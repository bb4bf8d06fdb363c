"""Laws of the peers' networks: what must not matter does not, what must be undone is undone."""

from dataclasses import replace

import pytest
import torch
from torch import Tensor

from kpred.ops.mean_value import mean_value_reference
from kpred.peers.networks import NeuralCages, NeuralCagesConfig, PartBoxes, ShapeFlow, ShapeFlowConfig, URed, URedConfig
from kpred.peers.networks.part_attention import STEP, PartAttention
from kpred.peers.training.neural_cages import normal_change
from kpred.peers.training.u_red import residual_error


@pytest.fixture
def clouds(generator: torch.Generator) -> Tensor:
    """Two shapes of 200 points in the unit box."""
    return 2 * torch.rand(2, 200, 3, generator=generator) - 1


@pytest.fixture
def cages() -> NeuralCages:
    torch.manual_seed(0)
    network = NeuralCages(NeuralCagesConfig(code_size=16))
    for decoder in (network.cage_decoder, network.motion_decoder):
        torch.nn.init.normal_(decoder.output.weight, std=0.05)
    return network


def test_an_untrained_cage_holds_the_unit_box_and_moves_nothing(clouds: Tensor) -> None:
    network = NeuralCages(NeuralCagesConfig(code_size=16))
    corners = torch.cartesian_prod(*[torch.tensor([-1.0, 1.0])] * 3)[None].expand(2, -1, -1)
    codes = network.encode(clouds)
    cage = network.cage(codes)
    weights = network.coordinates(corners, cage)
    assert weights.min() > 0
    torch.testing.assert_close(weights @ cage, corners, atol=1e-5, rtol=0)
    assert network.motion(codes, codes.flip(0), cage).abs().max() == 0


def test_neural_cages_do_not_depend_on_the_order_of_points(cages: NeuralCages, clouds: Tensor) -> None:
    mixed = clouds[:, torch.randperm(clouds.shape[1])]
    torch.testing.assert_close(cages.encode(mixed), cages.encode(clouds))
    codes = cages.encode(clouds)
    # A vertex moves by its place, not by its number.
    order = torch.randperm(42)
    cage = cages.cage(codes)
    moved = cages.motion(codes, codes.flip(0), cage[:, order])
    torch.testing.assert_close(moved, cages.motion(codes, codes.flip(0), cage)[:, order])


def test_coordinates_teach_the_cage(cages: NeuralCages, clouds: Tensor) -> None:
    cage = cages.cage(cages.encode(clouds))
    weights = cages.coordinates(clouds, cage)
    torch.testing.assert_close(weights, mean_value_reference(clouds, cage.detach(), cages.faces))
    weights.square().sum().backward()
    gradient = cages.cage_decoder.output.weight.grad
    assert gradient is not None
    assert torch.isfinite(gradient).all()
    assert gradient.abs().max() > 0


def test_normals_change_by_bending_alone(clouds: Tensor, generator: torch.Generator) -> None:
    assert normal_change(clouds, 1.3 * clouds + 0.2) < 1e-5
    assert normal_change(clouds, clouds + 0.1 * torch.randn(clouds.shape, generator=generator)) > 0.05
    turned = clouds @ torch.tensor([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    assert normal_change(clouds, turned) > 0.3


@pytest.fixture
def flow() -> ShapeFlow:
    torch.manual_seed(0)
    return ShapeFlow(ShapeFlowConfig(sources=("a", "b", "c"), code_size=8, width=16, steps=4))


def test_what_flows_to_the_hub_flows_back(flow: ShapeFlow, clouds: Tensor) -> None:
    codes = flow.code(flow.rows(("c", "a")))
    hub = flow.to_hub(clouds, codes)
    assert (hub - clouds).abs().max() > 0.01
    torch.testing.assert_close(flow.from_hub(hub, codes), clouds, atol=1e-4, rtol=0)
    # The hub is where the code is nothing.
    torch.testing.assert_close(flow.to_hub(clouds, torch.zeros(2, 8)), clouds, atol=1e-5, rtol=0)


def test_points_flow_on_their_own(flow: ShapeFlow, clouds: Tensor) -> None:
    codes = flow.code(flow.rows(("a", "b")))
    whole = flow.from_hub(clouds, codes)
    torch.testing.assert_close(flow.from_hub(clouds[:, 50:60], codes), whole[:, 50:60])
    torch.testing.assert_close(flow.from_hub(clouds[1:], codes[1:]), whole[1:])


def test_mirrored_points_flow_to_mirrored_places_and_none_crosses_the_middle(flow: ShapeFlow, clouds: Tensor) -> None:
    codes, mirror = flow.code(flow.rows(("a", "b"))), torch.tensor([-1.0, 1.0, 1.0])
    flown = flow.from_hub(clouds, codes)
    torch.testing.assert_close(flow.from_hub(clouds * mirror, codes), flown * mirror)
    assert (flown[..., 0] * clouds[..., 0] >= 0).all()
    # Points outside of the box come to places that are numbers, however strong the flow.
    with torch.no_grad():
        flow.output.weight.mul_(30)
    assert flow.from_hub(4 * clouds, codes).isfinite().all()
    free = ShapeFlow(replace(flow.config, symmetric=False))
    free.load_state_dict(flow.state_dict())
    assert (free.from_hub(clouds * mirror, codes) - free.from_hub(clouds, codes) * mirror).abs().max() > 1e-3


@pytest.fixture
def boxes(clouds: Tensor) -> PartBoxes:
    """Three parts of each cloud, by height, among five."""
    labels = ((clouds[..., 1] + 1) * 1.5).long().clamp(0, 2)
    return PartBoxes.stack([PartBoxes.of_shape(cloud, label, 5) for cloud, label in zip(clouds, labels, strict=True)])


def test_attention_follows_the_order_of_parts_and_ignores_empty_ones(generator: torch.Generator) -> None:
    torch.manual_seed(0)
    network = PartAttention(code_size=16, width=8, rounds=2, heads=2)
    source, target, parts = torch.randn(3, 16), torch.randn(3, 16), torch.randn(3, 6, 16)
    there = torch.tensor([[True] * 4 + [False] * 2] * 3)

    def motion_of(target: Tensor, parts: Tensor) -> Tensor:
        return network(source, target, network.describe(parts, there), there)

    motion = motion_of(target, parts)
    order = torch.tensor([2, 0, 3, 1, 4, 5])
    torch.testing.assert_close(motion_of(target, parts[:, order]), motion[:, order], atol=1e-6, rtol=0)
    changed = torch.where(there[..., None], parts, 100.0)
    torch.testing.assert_close(motion_of(target, changed)[:, :4], motion[:, :4], atol=1e-6, rtol=0)
    assert (motion_of(target.flip(0), parts) - motion)[0].abs().max() > 1e-4 * STEP


def test_part_codes_are_means_of_their_points(clouds: Tensor, boxes: PartBoxes) -> None:
    network = URed(URedConfig(parts=5, width=8, rounds=1))
    features = torch.randn(2, clouds.shape[1], 256)
    codes = network.part_codes(features, boxes)
    for shape in range(2):
        for part in range(3):
            own = features[shape, boxes.labels[shape] == part]
            torch.testing.assert_close(codes[shape, part], own.mean(0), atol=1e-5, rtol=0)
    assert codes[:, 3:].abs().max() == 0


def test_residuals_of_many_sources_are_those_of_each(clouds: Tensor) -> None:
    torch.manual_seed(0)
    branch = URed(URedConfig(parts=5, width=8, rounds=1)).partial
    features, own = branch.encoder.of_points(clouds[:1]), branch.encoder(clouds[:1])
    codes, sphere = torch.randn(4, 256), torch.randn(1, 256)
    together = URed.score(branch.residual(features, own, codes, sphere))
    alone = [URed.score(branch.residual(features, own, code[None], sphere)) for code in codes]
    torch.testing.assert_close(together, torch.cat(alone))
    # One decoding of the points serves all codes.
    rows = torch.zeros(4, dtype=torch.long)
    shared = URed.score(branch.residual(features, own.expand(4, -1), codes, sphere.expand(4, -1), rows=rows))
    torch.testing.assert_close(shared, together)


def test_the_branch_for_partial_targets_starts_as_that_for_whole_ones(clouds: Tensor) -> None:
    torch.manual_seed(0)
    network = URed(URedConfig(parts=5, width=8, rounds=1))
    third = network.partial.residual.codes[2].weight.clone()
    network.partial.start_from(network.whole)
    torch.testing.assert_close(network.partial.encoder(clouds), network.whole.encoder(clouds))
    # The point of the sphere is its own.
    torch.testing.assert_close(network.partial.residual.codes[2].weight, third)


def test_the_right_residual_costs_least(clouds: Tensor) -> None:
    target, result = clouds[:1], clouds[1:]
    nearest = torch.cdist(target, result).argmin(2)
    right = result[:, nearest[0]] - target
    cost = residual_error(target, result, right)
    torch.testing.assert_close(cost, 0.01 * right.abs().sum(2).mean(), atol=1e-6, rtol=0)
    assert residual_error(target, result, torch.zeros_like(right)) > cost
