"""Keypoint refinement: given a deformation basis, better keypoints are a linear least-squares problem.

Between two nearest-neighbour searches the deformed source S + B d is linear in the keypoint displacements d, with one
K x K matrix for x, y and z. Alternating the two lowers a robust, weighted Chamfer distance (or its one-sided form for
partial scans). A prior holds the surface that no point of a partial scan speaks for where the network put it: the
error of the whole surface is that of the seen part, plus how far the unseen part is moved off the best guess there is.
Two more things are known of the unseen part, and pull at it: space that the sensor looked through is empty, and the
scan's mirror image is likely.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from kpred.ops.nearest import nearest_neighbours
from kpred.ops.typing import Float
from kpred.ops.weighted_sums import MIN_SCALE, geman_mcclure, robust_scale, robust_weights
from kpred.refinement.config import RefineConfig as RefineConfig
from kpred.refinement.free_space import DepthPicture
from kpred.refinement.normal_equations import NormalEquations
from kpred.refinement.symmetry import Reflection

try:
    from kpred.refinement.keypoints_cpu import columns_and_guess, refine_compiled
except ImportError:  # numba is absent on machines that only train
    refine_compiled = None  # type: ignore[assignment]

UNSEEN_DISTANCE = 0.2
"""A point of the source counts half as unseen at this distance from the scan (unit box)."""

STRAY_REFLECTION = 8.0
"""A mirrored point farther from the result than this many times the scan's median distance counts less and less."""

STRAY_DEPTH = 0.5
"""Surface that is farther from what the sensor saw counts less and less: it belongs elsewhere (unit box)."""

QUERY_STRIDE = 2
"""Each round queries every second point of each side, alternating the offset, among all points of the other side. The
result is as good as with all queries, in half of the time.
"""

FREE_SPACE_POINTS = 256
"""Points of each source that are looked up in the sensors' pictures, in each round."""


@dataclass(frozen=True, eq=False)
class Refined:
    """What refinement finds of C candidates.

    Attributes:
        displacement: (C, K, 3) of the source's keypoints, unit box.
        error: (C,) mean squared distance of those points that were matched in the last round, before it moved them;
            both ways for whole scans.
    """

    displacement: Float[Tensor, "candidates keypoints 3"]
    error: Float[Tensor, " candidates"]


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
) -> Float[Tensor, "candidates keypoints 3"]:
    """Refine displacements of the source keypoints, unit box, without hints; see `refine_candidates`."""
    return refine_candidates(points, basis, displacement, target, confidence, config, partial).displacement


def refine_candidates(
    points: Float[Tensor, "candidates points 3"],
    basis: Float[Tensor, "candidates points keypoints"],
    displacement: Float[Tensor, "candidates keypoints 3"],
    target: Float[Tensor, "target 3"] | Float[Tensor, "candidates target 3"],
    confidence: Float[Tensor, " keypoints"] | Float[Tensor, "candidates keypoints"],
    config: RefineConfig,
    partial: bool,
    network_displacement: Float[Tensor, "candidates keypoints 3"] | None = None,
    hints: Hints | None = None,
) -> Refined:
    """Refine keypoints so that each candidate comes closer to the target; all in the unit box.

    Args:
        points: source points of every candidate; basis: their deformation basis B, so that S' = S + B d.
        displacement: start of the search; the network's K_target - K_source unless that is given too.
        target: the scan, one for all candidates or one for each.
        confidence: D_i in [0, 1], for all candidates or for each; in a partial scan a keypoint of low confidence is
            held more by the prior, beside what holds the unseen surface.
        partial: only target-to-source distances count, since the unseen part of the source has nothing to match.
        network_displacement: the centre of the prior, where refinement goes on from another start.
        hints: what else is known of a partial scan; the target is then one for all candidates.
    """
    network = displacement if network_displacement is None else network_displacement
    problem = _Problem.of(points, basis, network, target, confidence, config, partial, hints or Hints())
    # Corrections to the network's result are unknown: every prior is centred on none.
    correction = displacement - network
    if problem.compiled:
        refined, error = _refine_compiled(problem, correction, config)
    else:
        refined, error = _refine_plain(problem, correction, config)
    return Refined(network + refined, error)


@dataclass(frozen=True, eq=False)
class _Problem:
    """What all rounds work with.

    Attributes:
        across: (C, K, n) transposed basis of some of the points; guess: (C, n, 3) where the network puts them.
        goal: (C, M, 3) some points of the scan, a view where it is one for all; hold: (C, K) weights of the prior.
        unseen: (C, K, K) what holds the unseen surface; partial: whether only the scan's points query.
        pictures, reflection: hints that are used; compiled: whether compiled rounds can do it.
    """

    across: Tensor
    guess: Tensor
    goal: Tensor
    hold: Tensor
    unseen: Tensor
    partial: bool
    pictures: tuple[DepthPicture, ...]
    reflection: Reflection | None
    compiled: bool

    @classmethod
    def of(
        cls,
        points: Tensor,
        basis: Tensor,
        network: Tensor,
        target: Tensor,
        confidence: Tensor,
        config: RefineConfig,
        partial: bool,
        hints: Hints,
    ) -> _Problem:
        """Set up; see `refine_candidates` for the arguments."""
        step = max(1, points.shape[1] // config.points)
        # One target for all is a view, which the nearest neighbours' search sorts once.
        goal = target[..., :: max(1, target.shape[-2] // config.points), :].expand(len(points), -1, -1)
        pictures = hints.pictures if partial and config.free_space > 0 else ()
        reflection = hints.reflection if partial and config.reflection > 0 else None
        single = points.device.type == "cpu" and points.dtype == network.dtype == torch.float32
        compiled = refine_compiled is not None and not pictures and single
        if compiled:
            shape, columns, moves = (part.contiguous().numpy() for part in (points, basis, network))
            across, guess = (torch.from_numpy(part) for part in columns_and_guess(shape, columns, moves, step))
        else:
            across = basis[:, ::step].transpose(1, 2).contiguous()
            guess = points[:, ::step] + across.transpose(1, 2) @ network
        hold = 1.0 + 4.0 * (1.0 - confidence) if partial else torch.ones_like(confidence)
        if partial and config.unseen > 0:
            unseen = config.unseen * _unseen_normal(across.transpose(1, 2), guess, goal)
        else:
            unseen = guess.new_zeros(len(guess), across.shape[1], across.shape[1])
        hold = hold.expand(len(guess), -1)
        return cls(across, guess, goal, hold, unseen, partial, pictures, reflection, compiled)


def _refine_compiled(problem: _Problem, correction: Tensor, config: RefineConfig) -> tuple[Tensor, Tensor]:
    """Run all rounds by compiled code."""
    found, goal, mirrored = correction.contiguous().clone(), problem.goal, problem.reflection
    images = goal.new_zeros(0, 3) if mirrored is None else mirrored.points
    likely = images[:, 0] if mirrored is None else config.reflection / len(images) * mirrored.weight
    scans = goal[:1] if goal.stride(0) == 0 else goal
    # The last of them is improved in place.
    parts = (problem.across, problem.guess, scans, images, likely, problem.unseen, problem.hold, found)
    error = refine_compiled(
        *(part.contiguous().numpy() for part in parts),
        rounds=config.iterations,
        stride=QUERY_STRIDE,
        robust=(config.robust**2, STRAY_REFLECTION**2, MIN_SCALE),
        prior=config.prior,
        partial=problem.partial,
    )
    return found, torch.from_numpy(error)


def _refine_plain(problem: _Problem, correction: Tensor, config: RefineConfig) -> tuple[Tensor, Tensor]:
    """Run all rounds by plain torch, on any device."""
    goal, guess = problem.goal, problem.guess
    rows = torch.arange(guess.shape[1], device=guess.device).expand(len(guess), -1)
    equations = NormalEquations(problem.across.transpose(1, 2), guess)
    empty: list[tuple[Tensor, Tensor, Tensor]] = []
    found, error = correction, guess.new_zeros(len(guess))
    for step in range(config.iterations):
        # So much faster than the basis times the displacement.
        moved = guess + (found.transpose(1, 2) @ problem.across).transpose(1, 2)
        offset = step % QUERY_STRIDE
        pairs, error = _match_scan(problem, moved, offset, config)
        equations.clear()
        equations.add_at(*pairs)
        # Surface hardly moves between two rounds, and the pictures cost as much as the neighbours do.
        if step % 2 == 0:
            empty = [_out_of_free_space(moved, goal, picture, config.free_space) for picture in problem.pictures]
        for freed in empty:
            equations.add_at(*freed)
        if not problem.partial:
            queries = rows[:, offset::QUERY_STRIDE]
            squared, index = nearest_neighbours(moved[:, offset::QUERY_STRIDE], goal)
            error = error + squared.mean(1)
            equations.add_at(queries, goal, robust_weights(squared, config.robust) / queries.shape[1], index)
        prior = torch.diag_embed(config.prior * equations.level()[:, None] * problem.hold)
        found = equations.solve(prior + problem.unseen)
    return found, error


def _match_scan(
    problem: _Problem, moved: Tensor, offset: int, config: RefineConfig
) -> tuple[tuple[Tensor, Tensor, Tensor], Tensor]:
    """Match some of the scan's points, and their mirror images, to the result: indices, places, weights; and errors."""
    goal, mirrored = problem.goal, problem.reflection
    queries = goal[:, offset::QUERY_STRIDE]
    count = queries.shape[1]
    places = queries if mirrored is None else torch.cat([queries, mirrored.points.expand(len(goal), -1, -1)], dim=1)
    squared, index = nearest_neighbours(places, moved)
    weight = robust_weights(squared[:, :count], config.robust) / count
    if mirrored is not None:
        likely = config.reflection * mirrored.weight / len(mirrored.weight)
        strays = geman_mcclure(squared[:, count:], robust_scale(squared[:, :count], STRAY_REFLECTION))
        weight = torch.cat([weight, likely * strays], dim=1)
    return (index, places, weight), squared[:, :count].mean(1)


def _unseen_normal(basis: Tensor, guess: Tensor, goal: Tensor) -> Tensor:
    """Compute the normal matrix (C, K, K) of how far keypoints move surface that the scan does not show.

    In these units the mean of the data term's matrix is that of the seen points. Keypoints that move only what is seen
    stay free, and those that move the same unseen surface are held together.
    """
    step = 2 if guess.shape[1] > 256 else 1
    few = guess[:, ::step].contiguous()
    squared, _ = nearest_neighbours(few, goal)
    fraction = unseen_fraction(squared) / few.shape[1]
    rows = basis[:, ::step]
    return rows.transpose(1, 2) @ (rows * fraction[..., None])


def unseen_fraction(squared: Float[Tensor, "*batch"]) -> Float[Tensor, "*batch"]:
    """Estimate how surely points are unseen, 0 to 1, by squared distances from the scan (unit box)."""
    return squared.square() / (squared.square() + UNSEEN_DISTANCE**4)


def _out_of_free_space(
    moved: Tensor, goal: Tensor, picture: DepthPicture, weight_of_all: float
) -> tuple[Tensor, Tensor, Tensor]:
    """Match points in seen-through space to the nearest that was seen; places and weights.

    Indices (C, F), places (C, F, 3), weights (C, F) of some of the points.
    """
    step = max(1, moved.shape[1] // FREE_SPACE_POINTS)
    few = moved[:, ::step]
    violating = picture.beyond(few)[0] > 0
    squared, index = nearest_neighbours(few[violating][None], goal[:1])
    wanted, weight = few.clone(), torch.zeros_like(few[..., 0])
    wanted[violating] = goal[0, index[0]]
    strays = geman_mcclure(squared[0], torch.full_like(squared[0], STRAY_DEPTH**2))
    weight[violating] = weight_of_all * strays / few.shape[1]
    rows = torch.arange(0, moved.shape[1], step, device=moved.device).expand(len(moved), -1)
    return rows, wanted, weight
