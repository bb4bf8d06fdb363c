"""The search by tokens in plain float64, model by model."""

import numpy as np

from kpred.database.search import SearchResult, as_result


def reference_search(
    model_ids: tuple[str, ...],
    tokens: np.ndarray,
    query: np.ndarray,
    weights: np.ndarray | None = None,
    top_k: int = 10,
) -> SearchResult:
    """Search tokens (M, K, C) for query (K, C) exactly in float64, as a reference for tests."""
    weigh = np.ones(len(query)) if weights is None else np.asarray(weights, dtype=np.float64)
    distances = []
    for model in np.asarray(tokens, dtype=np.float64):
        distances.append(sum(w * np.abs(a - b).sum() for w, a, b in zip(weigh, query, model, strict=True)))
    return as_result(sorted(zip(distances, model_ids, strict=True))[:top_k])
