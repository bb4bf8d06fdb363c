"""A made-up folder in Scan2CAD's layout: generated furniture in scenes, with what is missing from real downloads.

It shows that a table, a check or a conversion runs on the whole layout before the data sets are there. Its errors say
nothing: shapes are the generator's, and scans are samples of their surfaces, cut by a plane, with noise.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
import trimesh
from scipy.spatial.transform import Rotation

from kpred.errors import ConfigError
from kpred.ops import sample_surface
from kpred.shapes.categories import SYNSETS
from kpred.shapes.mesh import Mesh
from kpred.synthetic.generator import generate

CATEGORIES = ("chair", "table", "cabinet")
MODELS = 4
"""Models of each category that the scenes draw from."""

SCAN_POINTS, FLOOR_POINTS = 900, 2500
NOISE = 0.004
SPACING = 2.5
"""Metres between neighbouring objects."""

SYNSET_OF = {name: synset for synset, name in SYNSETS.items() if name in CATEGORIES}

TO_Z_UP = Rotation.from_euler("x", 90, degrees=True)


@dataclass(frozen=True)
class MadeUp:
    """What was written.

    Attributes:
        objects: annotated objects of the three categories whose scan and model are there.
        missing_scans, missing_models, others: what is not: scenes without a scan, objects without a model's file, and
            objects of other categories.
    """

    objects: int = 0
    missing_scans: int = 0
    missing_models: int = 0
    others: int = 0


def write_made_up_scan2cad(folder: Path, scenes: int, seed: int = 0) -> MadeUp:
    """Write `scenes` scenes of two to four objects; every tenth has no scan, every seventh an object without a model.

    Raises:
        ConfigError: there would be no scene.
    """
    if scenes < 1:
        raise ConfigError(f"A layout needs at least one scene, but scenes = {scenes}.")
    random = np.random.default_rng(seed)
    models = {category: _write_models(folder, category, seed) for category in CATEGORIES}
    annotations, counts = [], {"objects": 0, "missing_scans": 0, "missing_models": 0, "others": 0}
    for number in range(scenes):
        scan = f"scene{9000 + number:04d}_00"
        entries, clouds = [], []
        for place in range(int(random.integers(2, 5))):
            category = CATEGORIES[int(random.integers(len(CATEGORIES)))]
            name, mesh = models[category][int(random.integers(MODELS))]
            entry, cloud = _object(category, name, mesh, SPACING * place, random)
            entries.append(entry)
            clouds.append(cloud)
        written = len(entries)
        if number % 7 == 3:
            entries[0]["id_cad"] = "not-downloaded"
            counts["missing_models"] += number % 10 != 9
            written -= 1
        entries.append({**entries[-1], "catid_cad": "02747177", "id_cad": "a-bin"})
        annotations.append({"id_scan": scan, "trs": _trs(np.zeros(3), Rotation.identity()), "aligned_models": entries})
        if number % 10 == 9:
            counts["missing_scans"] += 1
            continue
        counts["objects"] += written
        counts["others"] += 1
        _write_scan(folder, scan, clouds, random)
    (folder / "full_annotations.json").write_text(json.dumps(annotations))
    return MadeUp(**counts)


def _write_models(folder: Path, category: str, seed: int) -> list[tuple[str, Mesh]]:
    """Write generated models in ShapeNet's frame (y up, front -z, diagonal of the box 1)."""
    found = []
    for number, shape in enumerate(generate(category, MODELS, seed, splits=False)):
        low, high = (bound.astype(np.float64) for bound in shape.bounds)
        vertices = (shape.vertices - (low + high) / 2) / np.linalg.norm(high - low) * [-1, 1, -1]
        name = f"{category}-{number}"
        place = folder / "Assets" / "shapenet-sample" / SYNSET_OF[category] / name / "models"
        place.mkdir(parents=True, exist_ok=True)
        trimesh.Trimesh(vertices, shape.faces, process=False).export(place / "model_normalized.obj")
        found.append((name, Mesh(vertices, shape.faces, name)))
    return found


def _object(
    category: str, name: str, mesh: Mesh, place: float, random: np.random.Generator
) -> tuple[dict[str, Any], np.ndarray]:
    """Place a model; return its annotation and its scan (N, 3), metres, z up."""
    turn = Rotation.from_euler("z", random.uniform(0, 360), degrees=True) * TO_Z_UP
    scale = random.uniform(0.9, 1.3) * random.uniform(0.95, 1.05, 3)
    points, _ = sample_surface(
        torch.from_numpy(mesh.vertices * scale).float(),
        torch.from_numpy(np.asarray(mesh.faces)).long(),
        2 * SCAN_POINTS,
        torch.Generator().manual_seed(int(random.integers(2**31))),
    )
    # What a camera on one side sees, about.
    side = Rotation.from_euler("y", random.uniform(0, 360), degrees=True).apply([1.0, 0.3, 0.0])
    seen = np.argsort(points.numpy() @ side)[-SCAN_POINTS:]
    height = -mesh.vertices[:, 1].min() * scale[1]
    where = np.array([place, random.uniform(-0.3, 0.3), height])
    cloud = turn.apply(points.numpy()[seen]) + where + random.normal(0, NOISE, (SCAN_POINTS, 3))
    middle, half = (mesh.vertices.max(0) + mesh.vertices.min(0)) / 2, np.ptp(mesh.vertices, axis=0) / 2
    entry = {
        "trs": _trs(where, turn, scale),
        "catid_cad": SYNSET_OF[category],
        "id_cad": name,
        "sym": "__SYM_NONE",
        "bbox": half.tolist(),
        "center": middle.tolist(),
    }
    return entry, cloud


def _write_scan(folder: Path, scan: str, clouds: list[np.ndarray], random: np.random.Generator) -> None:
    floor = np.column_stack(
        [random.uniform(-2, SPACING * len(clouds), FLOOR_POINTS), random.uniform(-2, 2, FLOOR_POINTS)]
    )
    points = np.concatenate([*clouds, np.column_stack([floor, random.normal(0, NOISE, FLOOR_POINTS)])])
    place = folder / "Assets" / "scannet-sample" / scan
    place.mkdir(parents=True, exist_ok=True)
    trimesh.PointCloud(points).export(place / f"{scan}_vh_clean_2.ply")


def _trs(where: np.ndarray, turn: Rotation, scale: np.ndarray | None = None) -> dict[str, list[float]]:
    return {
        "translation": where.tolist(),
        "rotation": turn.as_quat()[[3, 0, 1, 2]].tolist(),
        "scale": (np.ones(3) if scale is None else scale).tolist(),
    }
