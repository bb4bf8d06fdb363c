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
from kpred.ops.weighted_sums import LEAST_SCALE, geman_mcclure, robust_scale, robust_weights

try:
    from kpred.fitting.refine_cpu import columns_and_guess, refine_compiled
except ImportError:  # numba is absent on machines that only train
    refine_compiled = None  # type: ignore[assignment]

UNSEEN_DISTANCE = 0.2
"""A point of the source counts half as unseen at this distance from the scan (unit box)."""

STRAY_REFLECTION = 8.0
"""A mirrored point farther from the result than this many times the scan's median distance counts less and less."""

STRAY_DEPTH = 0.5
"""Surface that is farther from what the sensor saw counts less and less: it belongs elsewhere (unit box)."""

ASKED_IN_TURN = 2
"""Every round asks for the nearest neighbours of so many-th of the points of each side, the next of the next: they are
searched among all of the other side. The result is as good as if all were asked, in half of the time.
"""

FREE_SPACE_POINTS = 256
"""Points of each source that are looked up in the sensors' pictures, in each round."""


@dataclass(frozen=True, eq=False)
class Refined:
    """What refinement finds of C candidates: the result is scale * (S + B displacement) + shift.

    Attributes:
        displacement: (C, K, 3) of the source's keypoints; scale: (C, 3), shift: (C, 3) of the box; unit box.
        error: (C,) mean squared distance of those points that were matched in the last round, before it moved them;
            both ways for full scans.
    """

    displacement: Tensor
    scale: Tensor
    shift: Tensor
    error: Tensor | None = None

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
    # One target for all is a view, which the nearest neighbours' search sorts once.
    goal = target[..., ::target_step, :].expand(len(points), -1, -1)
    network = start.displacement if network_displacement is None else network_displacement
    pictures = hints.pictures if hints is not None and partial and config.free_space > 0 else ()
    mirrored = hints.reflection if hints is not None and partial and config.reflection > 0 else None
    plain = refine_compiled is not None and not pictures and _is_plain(points, start, config)
    # Corrections to the network's result are unknown: every prior is centred on none.
    if plain:
        shape, columns, moves = (array.contiguous().numpy() for array in (points, basis, network))
        across, guess = (torch.from_numpy(array) for array in columns_and_guess(shape, columns, moves, source_step))
        few_basis = across.transpose(1, 2)
    else:
        few_basis = basis[:, ::source_step].contiguous()
        guess = points[:, ::source_step] + few_basis @ network
    hold = 1.0 + 4.0 * (1.0 - confidence) if partial else torch.ones_like(confidence)
    unseen = config.unseen * _unseen_normal(few_basis, guess, goal) if partial and config.unseen > 0 else None
    if plain:
        held = guess.new_zeros(len(guess), *2 * few_basis.shape[2:]) if unseen is None else unseen
        correction = (start.displacement - network).contiguous()
        images = goal.new_zeros(0, 3) if mirrored is None else mirrored.points
        likely = images[:, 0] if mirrored is None else config.reflection / len(images) * mirrored.weight
        shared = goal[:1] if goal.stride(0) == 0 else goal
        parts = (across, guess, shared, images, likely, held, hold.expand(len(guess), -1), correction)
        robust = (config.robust**2, STRAY_REFLECTION**2, LEAST_SCALE)
        last = refine_compiled(
            *(part.contiguous().numpy() for part in parts),
            rounds=config.iterations,
            asked_in_turn=ASKED_IN_TURN,
            robust=robust,
            prior=config.prior,
            partial=partial,
        )
        return replace(Refined.in_fixed_box(network + correction), error=torch.from_numpy(last))
    rows = torch.arange(guess.shape[1], device=guess.device).expand(len(guess), -1)
    found = start
    empty: list[tuple[Tensor, Tensor, Tensor]] = []
    equations = NormalEquations(few_basis if config.box == "fixed" else with_box(few_basis, guess), guess)
    across = equations.across[:, : basis.shape[2]]
    for step in range(config.iterations):
        # So much faster than the basis times the displacement.
        moved = guess + ((found.displacement - network).transpose(1, 2) @ across).transpose(1, 2)
        moved = found.scale[:, None] * moved + found.shift[:, None]
        turn = step % ASKED_IN_TURN
        asked = goal[:, turn::ASKED_IN_TURN]
        searched = asked if mirrored is None else torch.cat([asked, mirrored.points.expand(len(goal), -1, -1)], dim=1)
        count = asked.shape[1]
        squared, index = nearest_neighbours(searched, moved)
        weight = robust_weights(squared[:, :count], config.robust) / count
        if config.trim > 0:
            weight = weight * _trimmed(squared[:, :count], config.trim)
        if mirrored is not None:
            likely = config.reflection * mirrored.weight / len(mirrored.weight)
            likely = likely * geman_mcclure(squared[:, count:], robust_scale(squared[:, :count], STRAY_REFLECTION))
            weight = torch.cat([weight, likely], dim=1)
        error = squared[:, :count].mean(1)
        equations.clear()
        # Surface hardly moves between two rounds, and the pictures cost as much as the neighbours do.
        if step % 2 == 0:
            empty = [_out_of_free_space(moved, goal, picture, config.free_space) for picture in pictures]
        for pairs in ((index, searched, weight), *empty):
            equations.add_at(*pairs)
        if not partial:
            asking = rows[:, turn::ASKED_IN_TURN]
            squared, index = nearest_neighbours(moved[:, turn::ASKED_IN_TURN], goal)
            error = error + squared.mean(1)
            weight = robust_weights(squared, config.robust) / asking.shape[1]
            equations.add_at(asking, goal, weight, index)
        held = torch.diag_embed(config.prior * equations.level(basis.shape[2])[:, None] * hold)
        held = held if unseen is None else held + unseen
        correction, scale, shift = equations.solve(held, config.box, config.box_prior)
        found = Refined(network + correction, scale, shift, error)
    return found


def _is_plain(points: Tensor, start: Refined, config: RefineConfig) -> bool:
    """Whether compiled rounds can do it."""
    single = points.device.type == "cpu" and points.dtype == start.displacement.dtype == torch.float32
    return single and config.box == "fixed" and config.trim <= 0 and bool((start.scale == 1).all())


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
    weight[violating] = most * geman_mcclure(squared[0], torch.full_like(squared[0], STRAY_DEPTH**2)) / few.shape[1]
    rows = torch.arange(0, moved.shape[1], step, device=moved.device).expand(len(moved), -1)
    return rows, wanted, weight


def _trimmed(squared: Tensor, share: float) -> Tensor:
    """1 for all but this share of the points of each candidate, those with the largest distances."""
    most = squared.quantile(1.0 - share, dim=1, keepdim=True)
    return (squared <= most).to(squared.dtype)
