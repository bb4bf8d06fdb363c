"""What all peers have as methods: trained networks by category."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Generic, TypeVar

from torch import Tensor

from kpred.errors import ModelError
from kpred.evaluation.methods.sources import Sources

Network = TypeVar("Network")

CHUNK = 16
"""Sources prepared at once."""


@dataclass(frozen=True)
class PeerMethod(Generic[Network]):
    """A peer's networks.

    Attributes:
        name: what its rows are called; networks: by category.
    """

    name: str
    networks: Mapping[str, Network]
    ranked: ClassVar[bool] = True

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


def nearest_undeformed(sources: Sources, target: Tensor, top_k: int, partial: bool) -> Tensor:
    """Return rows of the nearest undeformed sources (CD; UCD if partial), for peers without retrieval."""
    return sources.undeformed_errors(target, partial).argsort(stable=True)[:top_k]
