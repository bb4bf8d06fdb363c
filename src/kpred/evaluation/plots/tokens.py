"""A map of retrieval tokens (the paper's t-SNE figure): models of like tokens lie together, some shown as pictures."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import torch

from kpred.database import Database
from kpred.evaluation.plots.figure import COLORS, new_figure
from kpred.evaluation.plots.tsne import tsne
from kpred.evaluation.plots.views import mesh_picture
from kpred.ops.typing import Float

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_THUMBNAIL = 160
"""Pixels of each picture."""


def token_distances(tokens: Float[np.ndarray, "models keypoints token"]) -> Float[np.ndarray, "models models"]:
    """Compute the distance of retrieval: L1, summed over keypoints of equal weight."""
    flat = torch.from_numpy(np.ascontiguousarray(tokens.reshape(len(tokens), -1), dtype=np.float32))
    return torch.cdist(flat, flat, p=1.0).numpy()


def tokens_figure(
    database: Database,
    category: str,
    pictures: int = 40,
    max_models: int = 600,
    perplexity: float = 20.0,
    seed: int = 0,
) -> Figure:
    """Draw the map of one category's models.

    Args:
        pictures: number shown as pictures, spread over the map; max_models: maximum number of models, drawn by seed.
        perplexity, seed: of the map.

    Raises:
        DatabaseError: the database has no models of the category.
    """
    ids = list(database.model_ids(category))
    if len(ids) > max_models:
        ids = sorted(np.random.default_rng(seed).choice(ids, max_models, replace=False).tolist())
    entries = [database.entry(name) for name in ids]
    places = tsne(token_distances(np.stack([entry.tokens for entry in entries])), perplexity, seed=seed)
    figure = new_figure(8.0, 8.0)
    axes: Any = figure.subplots()
    axes.scatter(places[:, 0], places[:, 1], s=6, color=COLORS[0], alpha=0.6, linewidths=0)
    span = float(np.ptp(places, axis=0).max()) or 1.0
    half = 0.5 * span / np.sqrt(max(pictures, 1)) * 0.8
    for row in spread(places, pictures, 1.6 * half):
        entry = entries[row]
        vertices = entry.frame.to_unit(entry.mesh.vertices.astype(np.float64))
        picture = mesh_picture(vertices, entry.mesh.faces, _THUMBNAIL)
        # White is glass, so that neighbours do not hide each other.
        alpha = np.where(picture.min(axis=2, keepdims=True) > 250, 0, 255).astype(np.uint8)
        x, y = places[row]
        axes.imshow(
            np.concatenate([picture, alpha], axis=2),
            extent=(x - half, x + half, y - half, y + half),
            zorder=3,
            interpolation="bilinear",
        )
    axes.set_xlim(places[:, 0].min() - half, places[:, 0].max() + half)
    axes.set_ylim(places[:, 1].min() - half, places[:, 1].max() + half)
    axes.set_aspect("equal")
    axes.set_xticks([])
    axes.set_yticks([])
    axes.set_title(f"retrieval tokens of {len(ids)} {category} models, t-SNE of their L1 distance", fontsize=10)
    return figure


def spread(places: Float[np.ndarray, "points 2"], count: int, apart: float) -> list[int]:
    """At most `count` rows, each at least `apart` from the others: farthest point after farthest point."""
    if not count:
        return []
    chosen = [int(np.linalg.norm(places - places.mean(axis=0), axis=1).argmin())]
    nearest = np.linalg.norm(places - places[chosen[0]], axis=1)
    while len(chosen) < min(count, len(places)) and nearest.max() >= apart:
        chosen.append(int(nearest.argmax()))
        nearest = np.minimum(nearest, np.linalg.norm(places - places[chosen[-1]], axis=1))
    return chosen
