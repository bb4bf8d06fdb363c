"""Keypoint refinement: given a deformation basis, better keypoints are a linear least-squares problem.

Between two nearest-neighbour searches the deformed source S + B d is linear in the keypoint displacements d, with one
K x K matrix shared by x, y and z. Alternating the two lowers a robust, weighted Chamfer distance (or its one-sided form
for partial scans). A prior holds the surface that no point of a partial scan speaks for where the network put it: the
error of the whole surface is that of the seen part, plus how far the unseen part is moved off the best guess there is.
Two more things are known of the unseen part, and pull at it: space that the sensor looked through is empty, and the
scan's mirror image is likely. With the box refined too, the result is s (S + B d) + t, and as linear in s, t and s d.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import torch
from torch import Tensor

from kpred.fitting.free_space import DepthPicture
from kpred.fitting.normal_equations import NormalEquations, with_box
from kpred.fitting.refine_config import RefineConfig as RefineConfig
from kpred.fitting.reflection import Reflection
from kpred.ops.nearest import nearest_neighbours
from kpred.ops.typing import Float

UNSEEN_DISTANCE = 0.2
"""A point of the source counts half as unseen at this distance from the scan (unit box)."""

STRAY_REFLECTION = 8.0
"""A mirrored point farther from the result than this many times the scan's median distance counts less and less."""

STRAY_DEPTH = 0.5
"""Surface that is farther from what the sensor saw counts less and less: it belongs elsewhere (unit box)."""

FREE_SPACE_POINTS = 256
"""Points of each source that are looked up in the sensors' pictures, in each round."""


@dataclass(frozen=True, eq=False)
class Refined:
    """What refinement finds of C candidates: the result is scale * (S + B displacement) + shift.

    Attributes:
        displacement: (C, K, 3) of the source's keypoints; scale: (C, 3), shift: (C, 3) of the box; unit box.
    """

    displacement: Tensor
    scale: Tensor
    shift: Tensor

    @classmethod
    def in_fixed_box(cls, displacement: Float[Tensor, "candidates keypoints 3"]) -> Refined:
        """Keypoints moved, the box where it is."""
        return cls(displacement, torch.ones_like(displacement[:, 0]), torch.zeros_like(displacement[:, 0]))


@dataclass(frozen=True, eq=False)
class Hints:
    """What is known of the unseen part of a partial scan, unit box.

    Attributes:
        pictures: what sensors saw of the scan; none where it is not known where they stood.
        reflection: the scan's mirror image.
    """

    pictures: tuple[DepthPicture, ...] = ()
    reflection: Reflection | None = None


def refine_keypoints(
    points: Float[Tensor, "candidates points 3"],
    basis: Float[Tensor, "candidates points keypoints"],
    displacement: Float[Tensor, "candidates keypoints 3"],
    target: Float[Tensor, "target 3"] | Float[Tensor, "candidates target 3"],
    confidence: Float[Tensor, " keypoints"] | Float[Tensor, "candidates keypoints"],
    config: RefineConfig,
    partial: bool,
    network_displacement: Float[Tensor, "candidates keypoints 3"] | None = None,
) -> Float[Tensor, "candidates keypoints 3"]:
    """Displacements of the source keypoints that bring each candidate closer to the target; all in the unit box.

    The box stays fixed. See `refine_candidates` for the arguments.
    """
    start = Refined.in_fixed_box(displacement)
    fixed = config if config.box == "fixed" else replace(config, box="fixed")
    return refine_candidates(
        points, basis, start, target, confidence, fixed, partial, network_displacement
    ).displacement


def refine_candidates(
    points: Float[Tensor, "candidates points 3"],
    basis: Float[Tensor, "candidates points keypoints"],
    start: Refined,
    target: Float[Tensor, "target 3"] | Float[Tensor, "candidates target 3"],
    confidence: Float[Tensor, " keypoints"] | Float[Tensor, "candidates keypoints"],
    config: RefineConfig,
    partial: bool,
    network_displacement: Float[Tensor, "candidates keypoints 3"] | None = None,
    hints: Hints | None = None,
) -> Refined:
    """Keypoints, and with `config.box` boxes, that bring each candidate closer to the target; all in the unit box.

    Args:
        points: source points of every candidate; basis: their deformation basis B, so that S' = S + B d.
        start: of the search; its displacement is the network's K_target - K_source unless that is given too.
        target: the scan, one for all candidates or one for each.
        confidence: D_i in [0, 1], for all candidates or for each; in a partial scan a keypoint of low confidence is
            held more by the prior, beside what holds the unseen surface.
        partial: only target-to-source distances count, since the unseen part of the source has nothing to match.
        network_displacement: the centre of the prior, where refinement goes on from another start.
        hints: what else is known of a partial scan; the target is then one for all candidates.
    """
    source_step = max(1, points.shape[1] // config.points)
    target_step = max(1, target.shape[-2] // config.points)
    few_basis = basis[:, ::source_step].contiguous()
    goal = target[..., ::target_step, :].expand(len(points), -1, -1).contiguous()
    network = start.displacement if network_displacement is None else network_displacement
    # Corrections to the network's result are unknown: every prior is centred on none.
    guess = points[:, ::source_step] + few_basis @ network
    columns = few_basis if config.box == "fixed" else with_box(few_basis, guess)
    hold = 1.0 + 4.0 * (1.0 - confidence) if partial else torch.ones_like(confidence)
    unseen = config.unseen * _unseen_normal(few_basis, guess, goal) if partial and config.unseen > 0 else None
    pictures = hints.pictures if hints is not None and partial and config.free_space > 0 else ()
    mirrored = hints.reflection if hints is not None and partial and config.reflection > 0 else None
    searched = goal if mirrored is None else torch.cat([goal, mirrored.points.expand(len(goal), -1, -1)], dim=1)
    count, found = goal.shape[1], start
    empty: list[tuple[Tensor, Tensor, Tensor]] = []
    for step in range(config.iterations):
        moved = guess + few_basis @ (found.displacement - network)
        moved = found.scale[:, None] * moved + found.shift[:, None]
        squared, index = nearest_neighbours(searched, moved)
        weight = _trimmed(squared[:, :count], config.trim) * _robust_weight(squared[:, :count], config.robust) / count
        if mirrored is not None:
            likely = config.reflection * mirrored.weight / len(mirrored.weight)
            likely = likely * _weight_at(squared[:, count:], _scale(squared[:, :count], STRAY_REFLECTION))
            weight = torch.cat([weight, likely], dim=1)
        equations = NormalEquations(columns, guess)
        # Surface hardly moves between two rounds, and the pictures cost as much as the neighbours do.
        if step % 2 == 0:
            empty = [_out_of_free_space(moved, goal, picture, config.free_space) for picture in pictures]
        pairs = [(index, searched, weight), *empty]
        equations.add_at(*(torch.cat(parts, dim=1) for parts in zip(*pairs, strict=True)))
        if not partial:
            squared, index = nearest_neighbours(moved, goal)
            weight = _robust_weight(squared, config.robust) / moved.shape[1]
            equations.add(_rows(goal, index), weight)
        held = torch.diag_embed(config.prior * equations.level(basis.shape[2])[:, None] * hold)
        held = held if unseen is None else held + unseen
        correction, scale, shift = equations.solve(held, config.box, config.box_prior)
        found = Refined(network + correction, scale, shift)
    return found


def _unseen_normal(basis: Tensor, guess: Tensor, goal: Tensor) -> Tensor:
    """Normal matrix (C, K, K) of how far corrections of the keypoints move the surface that the scan does not show.

    In these units the mean of the data term's matrix is that of the seen points. Keypoints that move only what is seen
    stay free, and those that share unseen surface are held together.
    """
    step = 2 if guess.shape[1] > 256 else 1
    few = guess[:, ::step].contiguous()
    squared, _ = nearest_neighbours(few, goal)
    share = unseen_share(squared) / few.shape[1]
    rows = basis[:, ::step]
    return rows.transpose(1, 2) @ (rows * share[..., None])


def unseen_share(squared: Float[Tensor, "*batch"]) -> Float[Tensor, "*batch"]:
    """How surely points of a result are unseen, in [0, 1], by their squared distances from the scan (unit box)."""
    return squared.square() / (squared.square() + UNSEEN_DISTANCE**4)


def _out_of_free_space(
    moved: Tensor, goal: Tensor, picture: DepthPicture, most: float
) -> tuple[Tensor, Tensor, Tensor]:
    """Where points in seen-through space should be, the nearest that was seen, and with which weight.

    Indices (C, F), places (C, F, 3), weights (C, F) of some of the points; `most` is the weight of all surface.
    """
    step = max(1, moved.shape[1] // FREE_SPACE_POINTS)
    few = moved[:, ::step]
    violating = picture.beyond(few)[0] > 0
    squared, index = nearest_neighbours(few[violating][None], goal[:1])
    wanted, weight = few.clone(), torch.zeros_like(few[..., 0])
    wanted[violating] = goal[0, index[0]]
    weight[violating] = most * _weight_at(squared[0], torch.full_like(squared[0], STRAY_DEPTH**2)) / few.shape[1]
    rows = torch.arange(0, moved.shape[1], step, device=moved.device).expand(len(moved), -1)
    return rows, wanted, weight


def _rows(values: Tensor, index: Tensor) -> Tensor:
    return torch.gather(values, 1, index[..., None].expand(-1, -1, values.shape[-1]))


def _trimmed(squared: Tensor, share: float) -> Tensor:
    """1 for all but this share of the points of each candidate, those with the largest distances."""
    if share <= 0:
        return torch.ones_like(squared)
    most = squared.quantile(1.0 - share, dim=1, keepdim=True)
    return (squared <= most).to(squared.dtype)


def _robust_weight(squared: Tensor, robust: float) -> Tensor:
    """Geman-McClure weights with a scale from the median distance, so that clean full scans are hardly touched."""
    return torch.ones_like(squared) if robust <= 0 else _weight_at(squared, _scale(squared, robust))


def _scale(squared: Tensor, times: float) -> Tensor:
    return squared.median(dim=1, keepdim=True).values * times**2 + 1e-4


def _weight_at(squared: Tensor, scale: Tensor) -> Tensor:
    return (scale / (scale + squared)).square()
