"""Many scans of one category in their known frames as one batch: encoded, searched, deformed and refined together.

torch alone, on any device. Results are those of `kpred.fitting.candidates`, scan by scan, up to rounding.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import torch
from torch import Tensor

from kpred.fitting.encoding import ScanEncoding, encode_scan
from kpred.nn import KPRed
from kpred.ops.chamfer import squared_distances
from kpred.ops.sampling import subsample
from kpred.ops.typing import Float, Int
from kpred.refinement.config import RefineConfig
from kpred.refinement.keypoints import Refined, refine_candidates


@dataclass(frozen=True, eq=False)
class ModelTable:
    """All models of a category, as tensors on one device.

    Attributes:
        tokens: (M, K, C); keypoints: (M, K, 3); points: (M, N, 3), unit box; basis: (M, N, K).
    """

    tokens: Tensor
    keypoints: Tensor
    points: Tensor
    basis: Tensor

    def nearest(
        self, tokens: Float[Tensor, "scans keypoints size"], weights: Float[Tensor, "scans keypoints"], top_k: int
    ) -> tuple[Int[Tensor, "scans models"], Float[Tensor, "scans models"]]:
        """Return rows and weighted L1 token distances of the `top_k` models nearest to each scan."""
        each = torch.cdist(tokens.transpose(0, 1).contiguous(), self.tokens.transpose(0, 1).contiguous(), p=1.0)
        distance = torch.einsum("ksm,sk->sm", each, weights)
        found = distance.topk(min(top_k, len(self.tokens)), dim=1, largest=False, sorted=True)
        return found.indices, found.values


@dataclass(frozen=True, eq=False)
class ScanBatch:
    """S scans, each with C retrieved models that are deformed to it; all in unit boxes.

    Attributes:
        targets: (S, P, 3) the scans; confidence: (S, K); partial: whether only scan-to-model distances count.
        rows: (S, C) of the models; distances: (S, C) of tokens.
        points: (S, C, N, 3); basis: (S, C, N, K); displacement: (S, C, K, 3) of the models' keypoints.
        finalists: (S, F) columns of those that were refined to the end; None where all are worth as much.
    """

    targets: Tensor
    confidence: Tensor
    partial: bool
    rows: Tensor
    distances: Tensor
    points: Tensor
    basis: Tensor
    displacement: Tensor
    finalists: Tensor | None = None

    @classmethod
    def retrieved(
        cls, scans: Float[Tensor, "scans points 3"], network: KPRed, table: ModelTable, top_k: int, partial: bool
    ) -> ScanBatch:
        """Encode scans by a network and retrieve the models nearest to each."""
        seen = encode_scan(scans, network, partial)
        rows, distances = table.nearest(seen.tokens, seen.weights, top_k)
        return cls.of(seen, rows, distances, table, partial)

    @classmethod
    def of(cls, seen: ScanEncoding, rows: Tensor, distances: Tensor, table: ModelTable, partial: bool) -> ScanBatch:
        """Build the batch of scans that are encoded and searched already."""
        displacement = seen.keypoints[:, None] - table.keypoints[rows]
        return cls(
            seen.points, seen.confidence, partial, rows, distances, table.points[rows], table.basis[rows], displacement
        )

    def deformed(self) -> Float[Tensor, "scans models points 3"]:
        """Compute S + B d of every model."""
        return self.points + self.basis @ self.displacement

    def errors(self, max_points: int | None = None) -> Float[Tensor, "scans models"]:
        """Compute CD (partial scans: UCD), unit box squared; infinite for models that refinement stopped.

        `max_points` bounds the queries of each cloud, which are searched among all points of the other.
        """
        if self.finalists is not None:
            errors = torch.full_like(self.distances, torch.inf)
            return errors.scatter(1, self.finalists, self.take(self.finalists).errors(max_points))
        scans, models = self.rows.shape
        result, goal = self.deformed().flatten(0, 1), self.targets.repeat_interleave(models, 0)
        forth = squared_distances(subsample(goal, max_points), result).mean(1)
        total = forth if self.partial else forth + squared_distances(subsample(result, max_points), goal).mean(1)
        return total.view(scans, models)

    def refined(self, config: RefineConfig) -> ScanBatch:
        """Refine keypoints of each scan's models: all by a few quick rounds, its finalists by all rounds."""
        finalists = config.most_finalists(self.partial)
        if self.rows.shape[1] <= finalists:
            found = self._refined(config, self.displacement).displacement
            return replace(self, displacement=found.view_as(self.displacement))
        quick = self._refined(config.quick(), self.displacement)
        started = replace(self, displacement=quick.displacement.view_as(self.displacement))
        ahead = quick.error.view_as(self.distances).argsort(dim=1, stable=True)[:, :finalists]
        found = started.take(ahead)._refined(config, self.take(ahead).displacement).displacement
        scan = torch.arange(len(ahead), device=ahead.device)[:, None]
        displacement = started.displacement.clone()
        displacement[scan, ahead] = found.unflatten(0, ahead.shape)
        return replace(self, displacement=displacement, finalists=ahead)

    def take(self, columns: Int[Tensor, "scans few"]) -> ScanBatch:
        """Select some of the models of each scan."""
        scan = torch.arange(len(columns), device=columns.device)[:, None]
        return replace(
            self,
            rows=self.rows[scan, columns],
            distances=self.distances[scan, columns],
            points=self.points[scan, columns],
            basis=self.basis[scan, columns],
            displacement=self.displacement[scan, columns],
            finalists=None,
        )

    def _refined(self, config: RefineConfig, network: Tensor) -> Refined:
        """Refine the models of all scans, flattened to one batch."""
        models = self.rows.shape[1]
        return refine_candidates(
            self.points.flatten(0, 1),
            self.basis.flatten(0, 1),
            self.displacement.flatten(0, 1),
            self.targets.repeat_interleave(models, 0),
            self.confidence.repeat_interleave(models, 0),
            config,
            self.partial,
            network.flatten(0, 1),
        )
