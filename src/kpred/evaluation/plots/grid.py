"""Qualitative grids (the paper's figures of results): each target beside what was retrieved and what was made of it."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
import trimesh
from PIL import Image, ImageDraw, ImageFont

from kpred.evaluation.database_source import Progress
from kpred.evaluation.plots.figure import new_figure, show_pictures
from kpred.evaluation.plots.views import blank, mesh_picture, with_points
from kpred.evaluation.scans.outcome import FailedFit, FitSettings, try_fit
from kpred.evaluation.tables.config import TableConfig
from kpred.evaluation.tables.make_table import loaded_models
from kpred.evaluation.tables.packs import OpenPack, Store, checked_packs, open_pack, pack_files
from kpred.evaluation.tables.scorer import check_names
from kpred.evaluation.tables.targets import Target
from kpred.fitting import Fit
from kpred.nn import Model
from kpred.ops.typing import Float

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_SIZE = 300
_SCAN = np.array([0.21, 0.40, 0.66])


@dataclass(frozen=True)
class GridConfig:
    """What a grid shows.

    Attributes:
        split, count, seed: which targets of each pack, drawn by seed.
        occlusion: fraction of the target that a plane hides; 0 shows and fits all of it.
        top_k: how many retrieved models are deformed and compared.
    """

    split: str = "val"
    count: int = 6
    seed: int = 0
    occlusion: float = 0.0
    top_k: int = 10


def grid_figure(
    packs: Sequence[str | os.PathLike[str]],
    models: Mapping[str, Model | str | os.PathLike[str] | None],
    config: GridConfig,
    databases: Mapping[str, Store] | None = None,
    *,
    cache: Path | None = None,
    progress: Progress | None = None,
    report: Callable[[str], None] = lambda sentence: None,
) -> Figure:
    """Targets in rows: their points, then of each model the results, feed-forward and refined, with errors.

    Everything is in the known frame. Under each result stands its CD, of partial targets UCD, unit box squared.

    Raises:
        PackError, ModelError, DatabaseError, ConfigError: see `kpred.evaluation.tables.make_table.make_table`.
    """
    check_names(list(models))
    loaded, stores = loaded_models(models), dict(databases or {})
    sources = checked_packs(
        pack_files(packs), list(loaded.values()), config.split, any(stores.get(name) is None for name in loaded)
    )
    chosen = TableConfig(split=config.split, limit=config.count, seed=config.seed, top_k=(config.top_k,))
    titles = ["target"]
    for name in loaded:
        shown = ["feed-forward", "source of refined", "refined"]
        titles += [f"{name}\n{what}" if len(loaded) > 1 else what for what in shown]
    rows: list[list[np.ndarray | None]] = []
    names: list[str] = []
    for source in sources:
        with open_pack(source, loaded, stores, chosen, cache, progress, report) as pack:
            for target in pack.targets:
                cells: list[np.ndarray | None] = [_points(_cloud(target, config).numpy())]
                for name, model in loaded.items():
                    cells += _results(
                        target, pack, FitSettings(model, pack.stores[name], config.top_k, 0), config, report
                    )
                rows.append(cells)
                names.append(f"{pack.category} {target.model_id[:12]}")
                if progress is not None:
                    progress("targets", len(rows), config.count * len(sources))
    figure = new_figure(1.9 * len(titles) + 0.3, 1.9 * len(rows) + 0.4)
    show_pictures(figure, rows, titles, names)
    return figure


def _cloud(target: Target, config: GridConfig) -> torch.Tensor:
    return target.visible(config.occlusion) if config.occlusion > 0 else target.points


def _results(
    target: Target, pack: OpenPack, settings: FitSettings, config: GridConfig, report: Callable[[str], None]
) -> list[np.ndarray | None]:
    cloud = _cloud(target, config).numpy().astype(np.float64)
    options: dict[str, Any] = {"frame": "known", "category": pack.category, "partial": config.occlusion > 0}
    refined = try_fit(cloud, settings, **options)
    plain = try_fit(cloud, settings, deform="paper", **options)
    if isinstance(refined, FailedFit):
        report(f"no result: {target.model_id}: {refined.reason}")
        return [None] * 3
    published = None if isinstance(plain, FailedFit) else _mesh(plain.mesh, _error(plain))
    return [published, _mesh(refined.retrieved_mesh, ""), _mesh(refined.mesh, _error(refined))]


def _error(found: Fit) -> str:
    return f"{found.source.error:.5f}"


def _points(points: Float[np.ndarray, "points 3"]) -> np.ndarray:
    height = (points[:, 1:2] - points[:, 1].min()) / max(float(np.ptp(points[:, 1])), 1e-9)
    return with_points(blank(_SIZE), points, _SCAN * (0.45 + 0.75 * height).clip(0, 1), 1.5)


def _mesh(mesh: trimesh.Trimesh, text: str) -> np.ndarray:
    picture = mesh_picture(np.asarray(mesh.vertices), np.asarray(mesh.faces), _SIZE)
    if not text:
        return picture
    canvas = Image.fromarray(picture)
    font = ImageFont.load_default(size=20)
    ImageDraw.Draw(canvas).text((8, _SIZE - 30), text, (60, 60, 60), font)
    return np.asarray(canvas)
