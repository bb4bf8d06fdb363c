"""The interface of everything that is measured: a target and sources in, retrieved ids and deformed points out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, runtime_checkable

from torch import Tensor

from kpred.ops.typing import Float

if TYPE_CHECKING:
    from kpred.evaluation.methods.sources import Sources


@dataclass(frozen=True, eq=False)
class Explanation:
    """What a method makes of one target: source shapes, the one it would take first, each as it deformed it.

    Attributes:
        model_ids: C ids of sources, in the order of retrieval.
        points: (C, N, 3) their deformed surfaces, unit box of the target.
        choose: from the errors (k,) of the first k the row that is the result; None takes the lowest error, as the
            published protocols do.
    """

    model_ids: tuple[str, ...]
    points: Tensor
    choose: Callable[[Tensor], int] | None = None

    def best(self, errors: Float[Tensor, " first"]) -> int:
        """Row of the result among the first so many, by their errors as they were measured."""
        return int(errors.argmin()) if self.choose is None else self.choose(errors)


@runtime_checkable
class Searcher(Protocol):
    """A method that has seen the source shapes of one category."""

    def explain(self, target: Float[Tensor, "points 3"], top_k: int, partial: bool) -> Explanation:
        """Retrieve at most `top_k` sources for a target and deform each to it.

        Args:
            target: surface points, in the unit box of the whole shape; of a partial target, those that are seen.
            partial: whether only a part is seen, so that only distances from target to result count.
        """
        ...


@runtime_checkable
class Method(Protocol):
    """Something that retrieves and deforms."""

    @property
    def name(self) -> str:
        """What its rows are called."""
        ...

    @property
    def ranked(self) -> bool:
        """Whether it matters how many sources are retrieved; one that looks at all of them has one row alone."""
        ...

    def over(self, sources: Sources) -> Searcher:
        """The method, ready to search these sources.

        Raises:
            ModelError: if it does not know their category, or one of them.
        """
        ...
