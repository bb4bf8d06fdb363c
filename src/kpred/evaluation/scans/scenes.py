"""Objects of a Scan2CAD scene: each fitted as `kpred scene` fits it, and compared with what the annotators put there.

The object's scan points are those that `kpred scene --objects full_annotations.json` takes. Distances are means from
these points to a surface: of the result, and of the annotated CAD model in its annotated pose. The centre is that of
Scan2CAD: the middle of the CAD model's own box, where it stands in the scene. All in metres, in the scan's frame.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from kpred.errors import KpredError, ScanError
from kpred.evaluation.database_source import Progress
from kpred.evaluation.metrics.summary import Scope, Summary
from kpred.evaluation.metrics.surfaces import Surface
from kpred.evaluation.metrics.symmetry import NONE, OF_SCAN2CAD, yaw_between, yaw_error
from kpred.evaluation.scans.outcome import FitOutcome, FitSettings, by_category, claims, known_values
from kpred.evaluation.scans.real_crops import SPLIT
from kpred.fitting.fit_scene import fit_scene
from kpred.fitting.object_fit import ObjectFit
from kpred.ops.rotations import upright_rotation, yaw_rotation
from kpred.rendering.contact_sheet import Tile
from kpred.scenes.objects import SceneObject, objects_of
from kpred.scenes.scan2cad import AlignedModel, compose, decompose, model_path, read_annotations
from kpred.scenes.scene import read_scene
from kpred.shapes.mesh_io import read_mesh

MAX_RATIO = 1.2
MAX_CENTRE_CM = 10.0
ANNOTATIONS = "full_annotations.json"


@dataclass(frozen=True, eq=False, kw_only=True)
class SceneOutcome(FitOutcome):
    """What became of one annotated object, fitted with its category given; `found` is that of a fit without it.

    Attributes:
        scene, name: of the object, as annotated; points: how many scan points it has.
        distance, annotated_distance: mean distance of the scan points to the result, and to the annotated CAD model, m.
        centre_cm: between the centres of the result and of the annotated CAD model.
        yaw: error in degrees up to the annotated symmetry; symmetry: its name.
        tile: picture of it.
    """

    scene: str
    name: str
    points: int
    distance: float | None = None
    annotated_distance: float | None = None
    centre_cm: float | None = None
    yaw: float | None = None
    symmetry: str = NONE.name
    tile: Tile | None = None

    @property
    def ratio(self) -> float | None:
        """Distance to the result / distance to the annotated CAD model."""
        if self.distance is None or self.annotated_distance is None:
            return None
        return self.distance / max(self.annotated_distance, np.finfo(float).tiny)

    @property
    def passes(self) -> bool:
        """Whether the result is at most 1.2 times as far as the annotated CAD model, and its centre within 10 cm."""
        if self.ratio is None or self.centre_cm is None:
            return False
        return self.ratio <= MAX_RATIO and self.centre_cm <= MAX_CENTRE_CM

    def facts(self) -> dict[str, Any]:
        """See `FitOutcome`."""
        return {"ratio": self.ratio, "passes": self.passes}


def evaluate_scenes(
    folder: str | os.PathLike[str],
    settings: FitSettings,
    annotations: str | os.PathLike[str] | None = None,
    *,
    progress: Progress | None = None,
    report: Callable[[str], None] | None = None,
) -> list[SceneOutcome]:
    """Outcomes of the annotated objects of known categories of all scenes of a folder; others go to `report`.

    Args:
        folder: laid out as Scan2CAD's repository: `full_annotations.json`, `Assets/scannet-sample/<scene>/`,
            `Assets/shapenet-sample/<synset>/<model>/`; or <scene>/ and <synset>/ in the folder itself.
        annotations: the file of annotations, where it lies elsewhere.

    Raises:
        ScanError: annotations or scans are missing or broken, or there is no annotated object of a known category.
    """
    root = Path(folder)
    outcomes: list[SceneOutcome] = []
    file = root / ANNOTATIONS if annotations is None else Path(annotations)
    for annotation in read_annotations(file):
        scene = read_scene(scan_of(root, annotation.id_scan))
        objects = objects_of(scene, file)
        known = [item for item in objects if item.category in settings.model.categories]
        for item in objects:
            if item not in known and report is not None:
                report(f"left out: {item.name}: {item.category} is not among the categories of the model.")
        if not known:
            continue
        name, total = f"{annotation.id_scan}: objects", len(objects) + len(known)
        options: dict[str, Any] = {"top_k": settings.top_k, "seed": settings.seed}
        step = _step(progress, name, 0, total)
        given = fit_scene(scene, objects, settings.model, settings.database, progress=step, **options)
        nameless = [replace(item, category=None) for item in known]
        step, floor = _step(progress, name, len(objects), total), given.floor or False
        free = fit_scene(scene, nameless, settings.model, settings.database, progress=step, floor=floor, **options)
        pairs = zip([fit for fit in given.fits if fit.object in known], free.fits, strict=True)
        outcomes += [_measured(annotation.id_scan, one, two, root) for one, two in pairs]
    if not outcomes:
        raise ScanError(f"{file}: it has no object of a known category ({', '.join(settings.model.categories)}).")
    return outcomes


def scan_of(root: Path, id_scan: str) -> Path:
    """ScanNet's file of a scan below a folder.

    Raises:
        ScanError: it is not there.
    """
    name = f"{id_scan}_vh_clean_2.ply"
    places = [folder / id_scan / name for folder in (root / "Assets" / "scannet-sample", root / "scans", root)]
    for file in places:
        if file.is_file():
            return file
    raise ScanError(
        f"{root}: it has no {places[0].relative_to(root)}; give a folder laid out as Scan2CAD's repository."
    )


def summarise_scenes(outcomes: Sequence[SceneOutcome], dataset: str, seed: int) -> list[Summary]:
    """Summaries of each category and of all objects; one without a result counts as wrong, and not in means."""
    rows: list[Summary] = []
    for category, mine in by_category(outcomes):
        fitted = [outcome for outcome in mine if outcome.failure is None]
        scope, frame = Scope(dataset, SPLIT, category, seed), "scan"
        distances, annotated = known_values(fitted, "distance"), known_values(fitted, "annotated_distance")
        rows += scope.mean("distance", distances, "m", frame)
        rows += scope.mean("annotated_distance", annotated, "m", frame)
        rows += scope.ratio("distance_ratio", distances, annotated, frame)
        rows += scope.mean("centre", known_values(fitted, "centre_cm"), "cm", frame)
        rows += scope.mean("yaw_error", known_values(fitted, "yaw"), "degrees", frame)
        rows += scope.fraction("category_right_not_given", [o.found == o.category for o in mine], frame)
        rows += scope.fraction("passes", [outcome.passes for outcome in mine], frame)
        rows += scope.median("milliseconds", known_values(fitted, "milliseconds"), "ms", frame)
    return rows


def annotated_mesh(model: AlignedModel, root: Path) -> trimesh.Trimesh:
    """Read the annotated CAD model, placed in the scan.

    Raises:
        MeshError: its file is missing or broken.
    """
    mesh = read_mesh(model_path(model, root))
    vertices = mesh.vertices.astype(np.float64) @ model.cad_to_scan[:3, :3].T + model.cad_to_scan[:3, 3]
    return trimesh.Trimesh(vertices, mesh.faces, process=False)


def annotated_rotation(model: AlignedModel) -> np.ndarray:
    """(3, 3) from the scan to canonical axes (y up, front +z); ShapeNet's models face -z."""
    rotation = decompose(model.cad_to_scan).rotation
    return np.asarray(yaw_rotation(np.pi) @ compose(np.zeros(3), rotation, np.ones(3))[:3, :3].T)


def annotated_centre(model: AlignedModel, placed: trimesh.Trimesh) -> np.ndarray:
    """(3,) where the middle of the CAD model's own box stands in the scan; `placed` is its mesh there."""
    if model.center is not None:
        return np.asarray(model.cad_to_scan[:3, :3] @ model.center + model.cad_to_scan[:3, 3])
    inverse = np.linalg.inv(model.cad_to_scan)
    own = np.asarray(placed.vertices) @ inverse[:3, :3].T + inverse[:3, 3]
    middle = (own.min(axis=0) + own.max(axis=0)) / 2
    return np.asarray(model.cad_to_scan[:3, :3] @ middle + model.cad_to_scan[:3, 3])


def _measured(scene: str, given: ObjectFit, free: ObjectFit, root: Path) -> SceneOutcome:
    item, model = given.object, given.object.annotation
    outcome = SceneOutcome(scene=scene, name=item.name, category=str(item.category), points=len(item.points))
    if given.fit is None or model is None:
        return _failed(outcome, item, given.error or f"{item.name}: it has no annotated CAD model.")
    try:
        placed, rotation = annotated_mesh(model, root), annotated_rotation(model)
        annotated = Surface(placed).distances(item.points)
    except KpredError as error:
        return _failed(outcome, item, str(error))
    except ValueError:
        return _failed(outcome, item, f"{item.name}: its annotated pose mirrors the CAD model; mend or remove it.")
    symmetry = OF_SCAN2CAD.get(model.sym, NONE)
    distance = float(Surface(given.fit.mesh).distances(item.points).mean())
    centre_cm = 100 * float(np.linalg.norm(given.cad_to_scan()[:3, 3] - annotated_centre(model, placed)))
    yaw = yaw_error(yaw_between(given.fit.frame.rotation, rotation), symmetry)
    said = claims(given.fit) | {"found": None if free.fit is None else free.fit.category}
    outcome = replace(
        outcome,
        distance=distance,
        annotated_distance=float(annotated.mean()),
        centre_cm=centre_cm,
        yaw=yaw,
        symmetry=symmetry.name,
        **said,
    )
    turned = trimesh.Trimesh(np.asarray(given.fit.mesh.vertices) @ rotation.T, given.fit.mesh.faces, process=False)
    lines = (
        f"{scene} {item.name}",
        f"{100 * distance:.1f} cm, annotated {100 * annotated.mean():.1f} cm",
        f"centre {centre_cm:.1f} cm, yaw {yaw:.0f}° off",
    )
    tile = Tile(lines, "right" if outcome.passes else "wrong", item.points @ rotation.T, turned)
    return replace(outcome, tile=tile)


def _failed(outcome: SceneOutcome, item: SceneObject, why: str) -> SceneOutcome:
    points = item.points @ upright_rotation(item.up).T if len(item.points) else np.zeros((1, 3))
    return replace(outcome, failure=why, tile=Tile((f"{outcome.scene} {item.name}", why), "wrong", points))


def _step(progress: Progress | None, name: str, start: int, total: int) -> Callable[[int, int, str], None] | None:
    return None if progress is None else lambda done, _all, _next: progress(name, start + done, total)
