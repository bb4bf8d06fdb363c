"""What all peers have as methods: trained networks by category, and the published choice of a result."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

from torch import Tensor

from kpred.errors import ModelError
from kpred.evaluation.methods.method import FEED_FORWARD, Prediction, Query, best_of_first
from kpred.evaluation.methods.sources import Sources
from kpred.ops.typing import Float

Network = TypeVar("Network")

CHUNK = 16
"""Sources prepared at once."""


@dataclass(frozen=True)
class PeerMethod(Generic[Network]):
    """A peer's networks.

    Attributes:
        name: of the peer in tables; networks: by category; provenance: what they were made by, as plain values.
    """

    name: str
    networks: Mapping[str, Network]
    provenance: dict[str, Any] = field(default_factory=dict)

    def network(self, sources: Sources) -> Network:
        """Return the network of the sources' category.

        Raises:
            ModelError: if there is none.
        """
        if sources.category not in self.networks:
            known = ", ".join(self.networks)
            raise ModelError(
                f"{self.name} knows no category '{sources.category}', only {known}; train it on that category."
            )
        return self.networks[sources.category]


@dataclass(frozen=True, eq=False)
class Deformed:
    """Sources that a peer retrieved for a target, in its order.

    Attributes:
        model_ids: C ids; points: (C, N, 3) their deformed surfaces, unit box of the target.
    """

    model_ids: tuple[str, ...]
    points: Float[Tensor, "sources points 3"]


class PeerSearcher(ABC):
    """A peer that has seen the sources of one category."""

    sources: Sources

    @abstractmethod
    def deform(self, cloud: Float[Tensor, "points 3"], top_k: int, partial: bool) -> Deformed:
        """Retrieve at most `top_k` sources for a target, unit box, and deform each to it."""

    def predict(self, query: Query) -> Iterator[Prediction]:
        """See `Searcher`."""
        found = self.deform(query.cloud, max(query.top_k), query.partial)
        yield from best_of_first(FEED_FORWARD, query, found.model_ids, found.points)

    def named(self, rows: Tensor, points: Tensor) -> Deformed:
        """Name deformed sources by their rows."""
        return Deformed(tuple(self.sources.model_ids[row] for row in rows.tolist()), points)


def nearest_undeformed(sources: Sources, target: Tensor, top_k: int, partial: bool) -> Tensor:
    """Find rows of the truly nearest sources as they are (CD; UCD if partial), for peers without a retrieval."""
    return sources.undeformed_errors(target, partial).argsort(stable=True)[:top_k]
