"""The interface of all that is measured: a query and sources in, retrieved ids and deformed points out."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

from torch import Tensor

from kpred.evaluation.metrics.cloud_errors import cloud_errors
from kpred.ops.typing import Float
from kpred.shapes.structure.cleanliness import Cleanliness

if TYPE_CHECKING:
    from kpred.evaluation.methods.sources import Sources

NO_MODEL = ""
"""Name of a method without trained networks."""

FEED_FORWARD, REFINED = "feed_forward", "refined"


@dataclass(frozen=True, eq=False)
class Query:
    """A target as a method sees it.

    Attributes:
        target: its id, for seeds and messages.
        cloud: its points in the unit box of the whole shape; of a partial target, those that are seen.
        partial: whether only a part is seen, so that only distances from target to result count.
        top_k: numbers of retrieved sources to deform and compare, ascending; each gets a prediction.
        oracle: whether the best of all sources is wanted too.
    """

    target: str
    cloud: Float[Tensor, "points 3"]
    partial: bool
    top_k: tuple[int, ...]
    oracle: bool = False


@dataclass(frozen=True, eq=False)
class Prediction:
    """What one method makes of a query: a source, deformed.

    Attributes:
        method: name of the row, as `refined`; top_k: how many sources were compared, None for all.
        model_id: of the source; points: (N, 3) its deformed surface, unit box of the target.
        error: its distance from the cloud, where the method chose by it; None has it measured.
        cleanliness: of the deformed mesh, where it is wanted.
    """

    method: str
    top_k: int | None
    model_id: str
    points: Float[Tensor, "points 3"]
    error: float | None = None
    cleanliness: Cleanliness | None = None


@runtime_checkable
class Searcher(Protocol):
    """A method that has seen the source shapes of one category."""

    def predict(self, query: Query) -> Iterator[Prediction]:
        """Retrieve sources for a query, deform them, and yield the result of each row and each top k."""
        ...


@runtime_checkable
class Method(Protocol):
    """Something that retrieves and deforms."""

    @property
    def name(self) -> str:
        """Name of its networks in tables; `NO_MODEL` for baselines."""
        ...

    @property
    def provenance(self) -> dict[str, Any]:
        """Plain values that say what it was made by."""
        ...

    def over(self, sources: Sources) -> Searcher:
        """Prepare the method to search these sources.

        Raises:
            ModelError: if it does not know their category, or one of them.
        """
        ...


def best_of_first(
    method: str, query: Query, model_ids: Sequence[str], results: Float[Tensor, "sources points 3"]
) -> Iterator[Prediction]:
    """Yield the result of the lowest error among the first k, for each top k, as the published protocols do."""
    errors = cloud_errors(query.cloud, results, query.partial)
    for k in query.top_k:
        row = int(errors[:k].argmin())
        yield Prediction(method, k, model_ids[row], results[row], float(errors[row]))
