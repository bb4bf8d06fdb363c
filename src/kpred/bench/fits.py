"""Time of a fit with warm model and database: 2048 points, top 10, a database of a thousand models."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import torch

from kpred.bench.figure import Figure, seconds, timed_figure
from kpred.database import Database, build_database
from kpred.fitting.pipeline import fit
from kpred.nn import Model
from kpred.ops import icosphere, sample_surface, unit_box_frame
from kpred.ops.mean_value import mean_value_reference
from kpred.ops.nearest import nearest_neighbours
from kpred.shapes.source import Shape
from kpred.synthetic.generator import generate

POINTS = 2048

CASES: dict[str, tuple[float, dict[str, Any]]] = {
    "fit, the paper's protocol": (15.0, {"deform": "paper", "frame": "known"}),
    "fit, the paper's protocol, all is seen": (15.0, {"deform": "paper", "frame": "known", "partial": False}),
    "fit, structure kept": (25.0, {"frame": "known"}),
    "fit, structure kept, all is seen": (25.0, {"frame": "known", "partial": False}),
    "fit, keypoints refined": (25.0, {"deform": "free", "frame": "known"}),
    "fit, everything unknown": (120.0, {"category": None}),
}
"""Case -> the most milliseconds that it may take, and options of `fit`."""


def models_database(path: Path, model: Model, models: int, report: Callable[[int, int], None]) -> Path:
    """Build a database of `models` generated models, a third of each category, unless it exists."""

    def shapes() -> Iterator[Shape]:
        for category in model.categories:
            pack = generate(category, -(-models // len(model.categories)), seed=7, splits=False)
            for name, mesh in zip(pack.model_id, pack, strict=True):
                yield Shape(str(name), category, "source", mesh)

    build_database(path, shapes(), model, progress=lambda done: report(done, models))
    return path


def scans(model: Model, count: int) -> dict[str, list[np.ndarray]]:
    """Sample full scans in their unit boxes, by category, of generated shapes that are in no database."""
    generator = torch.Generator().manual_seed(0)
    found: dict[str, list[np.ndarray]] = {}
    for category in model.categories:
        found[category] = []
        for mesh in generate(category, -(-count // len(model.categories)), seed=99):
            vertices, faces = torch.from_numpy(mesh.vertices), torch.from_numpy(mesh.faces).long()
            cloud = sample_surface(vertices, faces, POINTS, generator)[0].double().numpy()
            found[category].append(unit_box_frame(cloud).to_unit(cloud))
    return found


def fit_figures(model: Model, path: Path, count: int, report: Callable[[int, int], None]) -> Iterator[Figure]:
    """Measure each case, also with the stored cage, coordinates and bases recomputed."""
    clouds = scans(model, count)
    jobs = [(category, cloud) for category, cloud in enumerate_clouds(clouds)]
    with Database.open(path, read_only=True) as database:
        plain = _recomputed(model, database, [category for category, _ in jobs[:3]])
        for done, (name, (limit, options)) in enumerate(CASES.items()):
            times: list[float] = []
            for category, cloud in jobs:
                chosen = {"category": category, **options}

                def once(cloud: np.ndarray = cloud, chosen: dict[str, Any] = chosen) -> object:
                    return fit(cloud, model, database, **chosen)

                # What a fit reads of the database is in memory then, as in a program that fits many scans.
                times += seconds(once, 1, warm=1)
            report(done + 1, len(CASES) + 1)
            middle = float(np.median(times))
            yield timed_figure(
                f"{name}, {len(database)} models",
                times,
                limit,
                "the ten candidates' coordinates computed again in plain torch",
                [middle + plain],
            )
        yield _nearest(database, jobs[0][0], jobs[0][1])
        report(len(CASES) + 1, len(CASES) + 1)


def enumerate_clouds(clouds: dict[str, list[np.ndarray]]) -> Iterator[tuple[str, np.ndarray]]:
    """Yield scans of all categories alternately."""
    for row in zip(*clouds.values(), strict=True):
        yield from zip(clouds, row, strict=True)


def _recomputed(model: Model, database: Database, categories: list[str]) -> float:
    """Measure median seconds for cage and mean value coordinates of ten models in plain torch."""
    times = []
    for category in categories:
        network = model[category]
        points = torch.from_numpy(database.candidates(category, database.model_ids(category)[:10]).points)
        faces = icosphere(network.config.cage_subdivisions)[1]

        def once(points: torch.Tensor = points, network: Any = network, faces: torch.Tensor = faces) -> object:
            return mean_value_reference(points, network.cage(points), faces)

        times += seconds(once, 1, warm=0)
    return float(np.median(times))


def _nearest(database: Database, category: str, cloud: np.ndarray) -> Figure:
    """Measure the Chamfer distance to ten candidates: compiled kernel and SciPy's KD-trees."""
    from scipy.spatial import cKDTree

    points = database.candidates(category, database.model_ids(category)[:10]).points
    target = cloud.astype(np.float32)
    many, one = torch.from_numpy(points), torch.from_numpy(target)[None].expand(len(points), -1, -1)

    def kernel() -> object:
        return nearest_neighbours(many, one), nearest_neighbours(one, many)

    def trees() -> object:
        tree = cKDTree(target)
        return [(tree.query(model), cKDTree(model).query(target)) for model in points]

    name = "Chamfer distances of ten candidates"
    return timed_figure(name, seconds(kernel, 10), None, "SciPy cKDTree", seconds(trees, 3))
