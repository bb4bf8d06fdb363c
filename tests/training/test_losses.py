"""The three stages: which parameters they teach, and what their losses measure."""

import pytest
import torch

from kpred.nn import STAGES, KPRed
from kpred.ops import nearest_neighbours
from kpred.training.config import PAPER
from kpred.training.losses import STAGE_CLASSES


def _losses(network: KPRed, data, config, stage: str, step: int = 100, seed: int = 0):
    work = STAGE_CLASSES[stage](network, data, config)
    return work, work.losses(step, torch.Generator().manual_seed(seed))


@pytest.mark.parametrize("stage", STAGES)
@pytest.mark.parametrize("head", ["voting", "regression"])
def test_gradients_reach_every_parameter_of_the_stage_and_none_outside(
    data, model_config, train_config, change, stage: str, head: str
) -> None:
    torch.manual_seed(0)
    network = KPRed(change(model_config, keypoint_head=head))
    for parameter in network.parameters():
        parameter.data += 0.02 * torch.randn_like(parameter)
    work, losses = _losses(network, data, train_config, stage)
    assert all(torch.isfinite(value) for value in losses.values())
    sum(losses.values()).backward()
    learned = {id(p) for p in work.parameters()}
    for name, parameter in network.named_parameters():
        inside = name.split(".")[0] in STAGES[stage]
        assert inside == (id(parameter) in learned) == parameter.requires_grad
        if not inside:
            assert parameter.grad is None, f"{name} is touched by the stage {stage}"
        elif name.endswith(("project.bias", "output.bias", "output.weight")):
            assert parameter.grad is not None and parameter.grad.abs().sum() > 0, name
        else:
            assert parameter.grad is not None and torch.isfinite(parameter.grad).all(), name
            assert parameter.grad.abs().sum() > 0, f"no gradient reaches {name}"


def test_warm_up_is_the_keypoint_loss_alone(network, data, train_config, change) -> None:
    config = change(train_config, warmup=10, late_step=20)
    names = {step: set(_losses(network, data, config, "deformation", step)[1]) for step in (0, 9, 10)}
    assert names[0] == names[9] == {"keypoints"}
    assert {"keypoints", "similarity"} < names[10]


def test_the_late_weight_of_the_keypoint_loss(network, data, train_config, change) -> None:
    config = change(train_config, late_step=5)
    early, late = (_losses(network, data, config, "deformation", step)[1]["keypoints"].item() for step in (4, 5))
    assert early / late == pytest.approx(config.keypoint_weight / config.keypoint_weight_late, rel=1e-4)


def test_similarity_against_a_slow_deformation(network, data, train_config, change) -> None:
    """C' = C + I^T (K_target - K_source) and S' = W C' (Eq. 1), with the source and target of the step."""
    config = change(train_config, source_choices=1, refined_weight=0.0, consistency_weight=0.0)
    work, losses = _losses(network, data, config, "deformation")
    generator = torch.Generator().manual_seed(0)
    target = data.draw_targets(2, config.points, config.stretch, generator)
    rows = data.draw_sources(2, generator)
    few = config.keypoint_points
    total = 0.0
    for goal, row in zip(target, rows, strict=True):
        source = data.points[row : row + 1]
        ours, theirs = network.keypoints(source[:, :few]), network.keypoints(goal[None, :few])
        cage = data.cages[row : row + 1]
        influence = network.influence(source, ours, cage)[0]
        moved = cage[0] + sum(influence[k][:, None] * (theirs - ours)[0, k] for k in range(12))
        deformed = data.weights[row].float() @ moved
        matrix = torch.cdist(goal, deformed.detach()).square()
        total += float(matrix.amin(0).mean() + matrix.amin(1).mean()) / 2
    # The coordinates are kept in half precision, hence the tolerance.
    assert losses["similarity"].item() == pytest.approx(total, rel=0.02)


def test_nearer_sources_are_chosen(network, data, train_config, change) -> None:
    config = change(train_config, source_choices=4, deformation=change(train_config.deformation, batch=16))
    work = STAGE_CLASSES["deformation"](network, data, config)
    generator = torch.Generator().manual_seed(0)
    target = data.draw_targets(16, config.points, 1.0, generator)
    state = generator.get_state()
    rows = work.draw_sources(target, None, generator)
    generator.set_state(state)
    choices = data.draw_sources(64, generator).view(16, 4)
    for goal, chosen, among in zip(target, rows, choices, strict=True):
        distance = [
            float(m.amin(0).mean() + m.amin(1).mean())
            for m in (torch.cdist(goal, data.points[row]).square() for row in among)
        ]
        assert chosen == among[int(torch.tensor(distance).argmin())]


def test_switches_of_the_retrieval_loss(network, data, train_config, change, model_config) -> None:
    full = _losses(network, data, train_config, "retrieval")[1]
    assert set(full) == {"reconstruction", "deformed", "ranking"}
    unranked = _losses(network, data, change(train_config, ranking_weight=0.0), "retrieval")[1]
    assert set(unranked) == {"reconstruction", "deformed"}
    plain = KPRed(change(model_config, deformation_aware=False))
    assert set(_losses(plain, data, train_config, "retrieval")[1]) == {"reconstruction"}


def test_switches_of_the_partial_loss(network, data, train_config, change) -> None:
    terms = {"keypoints", "similarity", "whole", "tokens", "box"}
    assert set(_losses(network, data, train_config, "partial")[1]) == terms
    paper = change(train_config, partial_token_weight=0.0, box_weight=0.0, whole_weight=0.0, scanned=0.0)
    assert set(_losses(network, data, paper, "partial")[1]) == {"keypoints", "similarity"}


def test_the_paper_trains_on_the_papers_losses_alone(network, data, change, train_config) -> None:
    small = {"points": train_config.points, "keypoint_points": 64}
    stages = {name: change(getattr(PAPER, name), batch=2) for name in STAGES}
    config = change(PAPER, **small, **stages)
    assert set(_losses(network, data, config, "deformation", 5000)[1]) == {"keypoints", "similarity"}
    assert set(_losses(network, data, config, "retrieval")[1]) == {"reconstruction", "deformed"}
    assert set(_losses(network, data, config, "partial")[1]) == {"keypoints", "similarity"}


def test_partial_clouds_show_part_of_their_targets(network, data, train_config, change) -> None:
    config = change(
        train_config,
        noise=0.0,
        outliers=0.0,
        scanned=0.0,
        occlusion=(0.5, 0.5),
        partial=change(train_config.partial, batch=4),
    )
    work = STAGE_CLASSES["partial"](network, data, config)
    target, seen = work.draw_partial_targets(None, torch.Generator().manual_seed(0))
    for whole, part in zip(target, seen, strict=True):
        assert nearest_neighbours(part[None], whole[None])[0].max() == 0
        assert len(part.unique(dim=0)) == config.points // 2


@pytest.mark.parametrize("stage", sorted(STAGE_CLASSES))
def test_half_precision_trains_nearly_as_single_does(network, data, train_config, change, stage: str) -> None:
    config = change(train_config, warmup=0)
    losses = {}
    for enabled in (False, True):
        work = STAGE_CLASSES[stage](network, data, config)
        with torch.autocast("cpu", torch.bfloat16, enabled=enabled):
            terms = work.losses(4, torch.Generator().manual_seed(0))
        torch.stack([term.float() for term in terms.values()]).sum().backward()
        losses[enabled] = {name: float(term.detach()) for name, term in terms.items()}
    assert losses[True].keys() == losses[False].keys()
    for name, value in losses[False].items():
        assert losses[True][name] == pytest.approx(value, rel=0.2, abs=0.02), name
