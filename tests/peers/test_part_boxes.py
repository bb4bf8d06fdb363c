"""Part boxes: contacts hold whatever is wanted, and what keeps them is not changed."""

import pytest
import torch
from torch import Tensor

from kpred.peers.networks.part_boxes import PartBoxes, contacts

TOP, LEFT, RIGHT = 0, 1, 2


@pytest.fixture
def table(generator: torch.Generator) -> tuple[Tensor, Tensor]:
    """A top on two legs, as solid boxes of points: (900, 3) and the part of each."""

    def box(low: tuple[float, ...], high: tuple[float, ...]) -> Tensor:
        corner, size = torch.tensor(low), torch.tensor(high) - torch.tensor(low)
        inside = torch.rand(300, 3, generator=generator)
        inside[:8] = torch.cartesian_prod(*[torch.tensor([0.0, 1.0])] * 3)
        return corner + size * inside

    points = torch.cat(
        [
            box((-1.0, 0.5, -0.5), (1.0, 0.6, 0.5)),
            box((-1.0, -0.5, -0.1), (-0.8, 0.5, 0.1)),
            box((0.8, -0.5, -0.1), (1.0, 0.5, 0.1)),
        ]
    )
    return points, torch.arange(3).repeat_interleave(300)


def _limits(points: Tensor, labels: Tensor) -> tuple[Tensor, Tensor]:
    pieces = [points[labels == part] for part in range(int(labels.max()) + 1)]
    return torch.stack([p.amin(0) for p in pieces]), torch.stack([p.amax(0) for p in pieces])


def test_contacts_are_where_parts_touch(table: tuple[Tensor, Tensor]) -> None:
    points, labels = table
    first, second, place = contacts(points, labels, *_limits(points, labels), torch.ones(3, dtype=torch.bool))
    assert list(zip(first.tolist(), second.tolist(), strict=True)) == [(TOP, LEFT), (TOP, RIGHT)]
    assert (place[:, 1] - 0.5).abs().max() < 0.1
    assert place[0, 0] < -0.7
    assert place[1, 0] > 0.7


def test_a_part_that_touches_nothing_is_held_to_the_nearest(table: tuple[Tensor, Tensor]) -> None:
    points, labels = table
    points = torch.where((labels == RIGHT)[:, None], points - torch.tensor([0.0, 0.8, 0.0]), points)
    first, second, _ = contacts(points, labels, *_limits(points, labels), torch.ones(3, dtype=torch.bool))
    assert (TOP, LEFT) in list(zip(first.tolist(), second.tolist(), strict=True))
    assert RIGHT in second.tolist()


def _motion(generator: torch.Generator, parts: int) -> Tensor:
    return 0.3 * torch.randn(1, parts, 6, generator=generator)


def test_contacts_stay_together_whatever_is_wanted(table: tuple[Tensor, Tensor], generator: torch.Generator) -> None:
    points, labels = table
    first, second, place = contacts(points, labels, *_limits(points, labels), torch.ones(3, dtype=torch.bool))
    # The touching points as points of both parts.
    both = torch.cat([points, place, place])
    boxes = PartBoxes.of_shape(points, labels, 5)
    low, high = _limits(points, labels)
    center, half = (low + high) / 2, ((high - low) / 2).clamp(min=0.02)
    owner = torch.cat([first, second])
    relative = torch.cat([boxes.relative, (torch.cat([place, place]) - center[owner]) / half[owner]])
    wider = PartBoxes(torch.cat([labels, owner])[None], relative[None], boxes.parts[None], boxes.projection[None])
    moved = wider.moved(both[None], _motion(generator, 5))[0, len(points) :]
    torch.testing.assert_close(moved[: len(first)], moved[len(first) :], atol=1e-4, rtol=0)
    assert (moved[: len(first)] - place).abs().max() > 0.01


def test_the_projection_changes_nothing_that_keeps_contacts(
    table: tuple[Tensor, Tensor], generator: torch.Generator
) -> None:
    points, labels = table
    boxes = PartBoxes.stack([PartBoxes.of_shape(points, labels, 4)])
    projection = boxes.projection[0]
    torch.testing.assert_close(projection @ projection, projection, atol=1e-4, rtol=0)
    torch.testing.assert_close(projection, projection.transpose(1, 2), atol=1e-5, rtol=0)
    # All parts moved alike; and the whole shape stretched: both keep every contact.
    shift = torch.zeros(1, 4, 6)
    shift[..., :3] = torch.tensor([0.1, -0.2, 0.3])
    torch.testing.assert_close(boxes.moved(points[None], shift)[0], points + shift[0, 0, :3], atol=1e-4, rtol=0)
    low, high = _limits(points, labels)
    stretch = torch.zeros(1, 4, 6)
    stretch[0, :3, :3], stretch[0, :3, 3:] = 0.2 * (low + high) / 2, 0.2 * ((high - low) / 2).clamp(min=0.02)
    torch.testing.assert_close(boxes.moved(points[None], stretch)[0], 1.2 * points, atol=1e-3, rtol=0)


def test_nothing_wanted_is_nothing_moved_and_empty_parts_do_not_count(
    table: tuple[Tensor, Tensor], generator: torch.Generator
) -> None:
    points, labels = table
    boxes = PartBoxes.stack([PartBoxes.of_shape(points, labels, 6)])
    assert boxes.parts[0].tolist() == [True] * 3 + [False] * 3
    assert torch.equal(boxes.moved(points[None], torch.zeros(1, 6, 6))[0], points)
    wanted = _motion(generator, 6)
    other = wanted.clone()
    other[:, 3:] = 100.0
    assert torch.equal(boxes.moved(points[None], wanted), boxes.moved(points[None], other))


def test_one_part_moves_freely(generator: torch.Generator) -> None:
    points = torch.rand(100, 3, generator=generator) - 0.5
    boxes = PartBoxes.stack([PartBoxes.of_shape(points, torch.zeros(100, dtype=torch.long), 2)])
    wanted = torch.zeros(1, 2, 6)
    wanted[0, 0, 0], wanted[0, 0, 4] = 0.3, 0.25
    moved = boxes.moved(points[None], wanted)[0]
    torch.testing.assert_close(moved[:, 0], points[:, 0] + 0.3)
    middle = (points[:, 1].amax() + points[:, 1].amin()) / 2
    half = (points[:, 1].amax() - points[:, 1].amin()) / 2
    torch.testing.assert_close(moved[:, 1], points[:, 1] + 0.25 * (points[:, 1] - middle) / half)
