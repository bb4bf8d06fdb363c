"""Keypoints across a category, and the influence of one keypoint on the cage and on the shape (the paper's figures)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import torch

from kpred.database import Database
from kpred.database.entry import Entry
from kpred.errors import ConfigError
from kpred.evaluation.plots.figure import new_figure, show_pictures
from kpred.evaluation.plots.views import blank, mesh_picture, view, with_keypoints, with_lines, with_points
from kpred.nn import KPRed
from kpred.ops.cage import icosphere

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_SIZE = 360
_FAINT = 0.35
_CAGE_REACH = 2.1
"""Cages reach beyond the unit box."""


def keypoints_figure(database: Database, category: str, count: int = 12, columns: int = 4, seed: int = 0) -> Figure:
    """Models of one category with their keypoints, each keypoint of one colour everywhere.

    Raises:
        DatabaseError: the database has no models of the category.
    """
    entries = chosen_entries(database, category, count, seed)
    pictures: list[np.ndarray | None] = [
        with_keypoints(mesh_picture(*_mesh(entry), _SIZE, _FAINT), entry.keypoints, 6.0) for entry in entries
    ]
    pictures += [None] * (-len(pictures) % columns)
    rows = [pictures[start : start + columns] for start in range(0, len(pictures), columns)]
    figure = new_figure(2.2 * columns, 2.2 * len(rows) + 0.4)
    show_pictures(figure, rows, [""] * columns, [""] * len(rows))
    figure.suptitle(f"{category}: the same colour is the same keypoint", fontsize=10)
    return figure


def influence_figure(
    database: Database, network: KPRed, keypoints: tuple[int, ...], count: int = 3, seed: int = 0
) -> Figure:
    """Draw what one keypoint moves: above the cage's vertices (I), below the shape's points (B = W I^T).

    Red moves along with the keypoint, blue against it, grey stays.

    Raises:
        ConfigError: a keypoint has no such number.
        DatabaseError: the database was made by other weights, or has no models of the category.
    """
    database.check_model(network)
    total = network.config.keypoints
    wrong = [number for number in keypoints if not 0 <= number < total]
    if wrong or not keypoints:
        raise ConfigError(f"Keypoints are numbered 0 to {total - 1}, but {wrong or 'none'} was given.")
    entries = chosen_entries(database, network.config.category, count, seed)
    rows: list[list[np.ndarray | None]] = []
    names = []
    for number, entry in enumerate(entries):
        points = torch.from_numpy(np.array(entry.points))[None]
        rest = torch.from_numpy(np.array(entry.keypoints))[None]
        with torch.inference_mode():
            cage = network.cage(points)
            influence = network.influence(points, rest, cage)[0].numpy()
        rows.append([_cage_picture(cage[0].numpy(), influence[k], entry, k) for k in keypoints])
        rows.append([_basis_picture(entry, k) for k in keypoints])
        names += [f"model {number + 1}: cage", "shape"]
    figure = new_figure(2.2 * len(keypoints) + 0.4, 2.2 * len(rows) + 0.6)
    show_pictures(figure, rows, [f"keypoint {k}" for k in keypoints], names)
    return figure


def chosen_entries(database: Database, category: str, count: int, seed: int) -> list[Entry]:
    """Draw some models of a category by seed.

    Raises:
        ConfigError: the count is below 1.
        DatabaseError: the database has no models of the category.
    """
    if count < 1:
        raise ConfigError(f"At least one model must be shown, not {count}.")
    ids = database.model_ids(category)
    rows = np.sort(np.random.default_rng(seed).permutation(len(ids))[:count])
    return [database.entry(ids[row]) for row in rows]


def _mesh(entry: Entry) -> tuple[np.ndarray, np.ndarray]:
    return entry.frame.to_unit(entry.mesh.vertices.astype(np.float64)), entry.mesh.faces


def _colors(influence: np.ndarray) -> np.ndarray:
    """(N, 3): -1 blue, 0 light grey, 1 red."""
    from matplotlib import colormaps

    return np.asarray(colormaps["coolwarm"](0.5 + 0.5 * influence.clip(-1, 1)))[:, :3]


def _cage_picture(cage: np.ndarray, influence: np.ndarray, entry: Entry, keypoint: int) -> np.ndarray:
    faces = icosphere(1 if len(cage) == 42 else 2)[1].numpy()
    edges = {(int(min(a, b)), int(max(a, b))) for face in faces for a, b in zip(face, np.roll(face, 1), strict=True)}
    mesh = mesh_picture(*_mesh(entry), _SIZE, _FAINT, _CAGE_REACH)
    picture = with_lines(mesh, cage, sorted(edges), np.full(3, 0.6), _CAGE_REACH)
    # Vertices at the back are smaller, so that the cage reads as a ball.
    depth = view(_SIZE).project(cage)[1]
    behind = depth > np.median(depth)
    for side, radius in ((behind, 3.0), (~behind, 6.0)):
        picture = with_points(picture, cage[side], _colors(influence)[side], radius, _CAGE_REACH)
    return _marked(picture, entry, keypoint)


def _basis_picture(entry: Entry, keypoint: int) -> np.ndarray:
    colors = _colors(entry.point_basis[:, keypoint])
    return _marked(with_points(blank(_SIZE), entry.points, colors, 2.0, _CAGE_REACH), entry, keypoint)


def _marked(picture: np.ndarray, entry: Entry, keypoint: int) -> np.ndarray:
    place = entry.keypoints[keypoint : keypoint + 1]
    ringed = with_points(picture, place, np.zeros(3), 7.0, _CAGE_REACH)
    return with_points(ringed, place, np.array([1.0, 0.85, 0.1]), 5.0, _CAGE_REACH)
