"""Scan2CAD's files: annotations of CAD models in ScanNet scenes, and results in the same form.

Source: Avetisyan et al., Scan2CAD, CVPR 2019, and the layout of its public repository. In `full_annotations.json` the
`trs` of a scene takes the scan into a y-up world, and the `trs` of a model takes ShapeNet's model_normalized.obj
(y up, front -z, diagonal of the box 1) into the same world, so that a model stands in the scan by
inverse(scene trs) times model trs. `bbox` and `center` are half the size and the middle of the model's own box in the
model's own frame; they do not enter the transform.
"""

from __future__ import annotations

import csv
import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from kpred.atomic import atomic_path
from kpred.errors import MeshError, ScanError
from kpred.ops.typing import Float
from kpred.shapes.categories import SYNSETS, category_of
from kpred.shapes.formats.text_lines import open_lines
from kpred.shapes.reading import check_file, reading

_MIN_SCALE = 1e-6
_MODEL_FILE = Path("models") / "model_normalized.obj"


@dataclass(frozen=True, eq=False)
class AlignedModel:
    """A CAD model in a scan.

    Attributes:
        name: category and number within the scene, such as `chair_1`.
        category: what its synset means; catid_cad, id_cad: ShapeNet's ids of category and model.
        cad_to_scan: (4, 4) for column vectors, from model_normalized.obj to the scan's own frame and units.
        sym: Scan2CAD's class of symmetry about the up axis.
        half_size, center: (3,) of the model's box in its own frame; None where the file has no bbox and center.
    """

    name: str
    category: str
    catid_cad: str
    id_cad: str
    cad_to_scan: np.ndarray
    sym: str = "__SYM_NONE"
    half_size: np.ndarray | None = None
    center: np.ndarray | None = None


@dataclass(frozen=True)
class BrokenModel:
    """An annotated model that cannot be used; `reason` is a sentence that names it."""

    name: str
    category: str
    catid_cad: str
    id_cad: str
    reason: str


@dataclass(frozen=True, eq=False)
class SceneAnnotation:
    """The CAD models of one scan.

    Attributes:
        id_scan: ScanNet's name of the scan, such as `scene0470_00`.
        scan_to_world: (4, 4) for column vectors, into the aligned y-up world.
        models: those that can be used, in the file's order; broken: the others.
        path: the file they come from.
    """

    id_scan: str
    scan_to_world: np.ndarray
    models: tuple[AlignedModel, ...]
    broken: tuple[BrokenModel, ...] = ()
    path: Path | None = None


@dataclass(frozen=True, eq=False)
class Alignment:
    """A CAD model aligned to a scan by scale, rotation (unit quaternion w, x, y, z) and translation.

    Attributes:
        catid_cad, id_cad: ids of category and model.
        translation: (3,); rotation: (4,); scale: (3,); they take the mesh into the scan's own frame and units.
        half_size: (3,) of the mesh's own box, whose middle is its origin.
        mesh: the file of the mesh, where it is not ShapeNet's own; node: its node in that file.
        name: of the object, for messages.
    """

    catid_cad: str
    id_cad: str
    translation: np.ndarray
    rotation: np.ndarray
    scale: np.ndarray
    half_size: np.ndarray
    mesh: str = ""
    node: str = ""
    name: str = ""

    def matrix(self) -> np.ndarray:
        """Return the matrix (4, 4), column vectors, from the mesh's frame to the scan's frame."""
        return compose(self.translation, self.rotation, self.scale)


def compose(translation: np.ndarray, rotation: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """Compose the matrix (4, 4) of scale, rotation (quaternion w, x, y, z) and translation, for column vectors."""
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_quat(np.asarray(rotation)[[1, 2, 3, 0]]).as_matrix() * np.asarray(scale)
    matrix[:3, 3] = translation
    return matrix


class Components(NamedTuple):
    """Translation (3,), rotation as quaternion w, x, y, z (4,) and scale (3,) of a transform."""

    translation: Float[np.ndarray, "3"]
    rotation: Float[np.ndarray, "4"]
    scale: Float[np.ndarray, "3"]


def decompose(matrix: Float[np.ndarray, "4 4"]) -> Components:
    """Decompose a matrix (4, 4) without shear; the quaternion has w >= 0."""
    scale = np.linalg.norm(matrix[:3, :3], axis=0)
    quaternion = Rotation.from_matrix(matrix[:3, :3] / scale).as_quat(canonical=True)
    return Components(matrix[:3, 3].copy(), quaternion[[3, 0, 1, 2]], scale)


def read_annotations(path: str | os.PathLike[str], id_scan: str | None = None) -> tuple[SceneAnnotation, ...]:
    """Read `full_annotations.json`; with `id_scan` only that scene.

    A model with a broken transform does not spoil its scene: it is listed in `SceneAnnotation.broken`.

    Raises:
        ScanError: the file is missing or no Scan2CAD annotation, lacks the scene, or a scene's own transform is broken.
    """
    file = Path(path)
    scenes = read_json(file)
    if isinstance(scenes, dict) and "aligned_models" in scenes:
        scenes = [scenes]
    if not isinstance(scenes, list) or not all(isinstance(s, dict) and "aligned_models" in s for s in scenes):
        raise ScanError(f"{file}: it is no Scan2CAD annotation; give a list of scenes with aligned_models.")
    if id_scan is not None:
        found = [scene for scene in scenes if scene.get("id_scan") == id_scan]
        if not found:
            raise ScanError(f"{file}: it has no annotation of {id_scan}; give the file that holds that scene.")
        scenes = found
    return tuple(_scene(scene, file) for scene in scenes)


def model_path(model: AlignedModel | BrokenModel, root: str | os.PathLike[str]) -> Path:
    """Return the file of an annotated model below a ShapeNet folder or a Scan2CAD repository.

    Raises:
        MeshError: it is not there; the message names the object.
    """
    tried = [Path(root), Path(root) / "Assets" / "shapenet-sample"]
    # Ids are names of folders; anything else would lead elsewhere.
    names = (model.catid_cad, model.id_cad)
    if any(len(name) > 200 or name in (".", "..") or set(name) & {"/", "\\", "\0"} for name in names):
        raise MeshError(f"{model.name}: its ids are no names of folders; mend the annotation.")
    for folder in tried:
        file = folder / model.catid_cad / model.id_cad / _MODEL_FILE
        if file.is_file():
            return file
    raise MeshError(
        f"{model.name}: its CAD model {model.catid_cad}/{model.id_cad}/{_MODEL_FILE} is not below {Path(root)}; "
        "give the ShapeNet folder that holds it."
    )


def read_json(file: Path) -> Any:
    """Read the content of a JSON file.

    Raises:
        ScanError: missing, unreadable or not JSON.
    """
    check_file(file, ScanError, "JSON file")
    with reading(file, ScanError), open_lines(file) as lines:
        try:
            return json.loads(b"".join(lines))
        except ValueError as error:
            raise ScanError(f"{file}: it is not valid JSON (damaged or cut short); copy it again.") from error


def results(id_scan: str, alignments: Sequence[Alignment], scan_to_world: np.ndarray | None = None) -> dict[str, Any]:
    """Return one scene's results in the form of an entry of `full_annotations.json`.

    Deformed meshes are no models of ShapeNet, so that every entry names its mesh too. `scan_to_world` (4, 4), without
    shear, is the scene's `trs`; None means that the world is the scan's own frame.
    """
    world = np.eye(4) if scan_to_world is None else scan_to_world
    models = []
    for alignment in alignments:
        entry: dict[str, Any] = {
            "trs": _trs(world @ alignment.matrix()),
            "catid_cad": alignment.catid_cad,
            "id_cad": alignment.id_cad,
            "sym": "__SYM_NONE",
            "bbox": alignment.half_size.tolist(),
            "center": [0.0, 0.0, 0.0],
        }
        extra = {"name": alignment.name, "mesh": alignment.mesh, "node": alignment.node}
        models.append(entry | {key: value for key, value in extra.items() if value})
    return {"id_scan": id_scan, "trs": _trs(world), "n_aligned_models": len(models), "aligned_models": models}


def write_csv(path: str | os.PathLike[str], alignments: Sequence[Alignment]) -> None:
    """Write a scene's results as Scan2CAD's benchmark reads them, whole or not at all.

    One line a model, without a header: catid_cad, id_cad, tx, ty, tz, qw, qx, qy, qz, sx, sy, sz, in the scan's own
    frame. The benchmark takes the file's stem as the scene's id.

    Raises:
        OutputError: the file cannot be written there.
    """
    with atomic_path(path) as temporary, open(temporary, "x", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        for alignment in alignments:
            numbers = np.concatenate([alignment.translation, alignment.rotation, alignment.scale])
            writer.writerow([alignment.catid_cad, alignment.id_cad, *(repr(float(number)) for number in numbers)])


def _trs(matrix: np.ndarray) -> dict[str, list[float]]:
    translation, rotation, scale = decompose(matrix)
    return {"translation": translation.tolist(), "rotation": rotation.tolist(), "scale": scale.tolist()}


def _scene(entry: Mapping[str, Any], file: Path) -> SceneAnnotation:
    id_scan = str(entry.get("id_scan", file.stem))
    scan_to_world, trouble = _matrix(entry.get("trs"))
    if trouble or not isinstance(entry["aligned_models"], list):
        trouble = trouble or "its aligned_models are no list"
        raise ScanError(f"{file}: the scene {id_scan} is broken ({trouble}); copy the annotation again.")
    models: list[AlignedModel] = []
    broken: list[BrokenModel] = []
    for number, item in enumerate(entry["aligned_models"]):
        model = _model(number, item, np.linalg.inv(scan_to_world), file)
        if isinstance(model, AlignedModel):
            models.append(model)
        else:
            broken.append(model)
    return SceneAnnotation(id_scan, scan_to_world, tuple(models), tuple(broken), file)


def _model(number: int, item: Any, world_to_scan: np.ndarray, file: Path) -> AlignedModel | BrokenModel:
    entry = item if isinstance(item, dict) else {}
    catid, id_cad = str(entry.get("catid_cad", "")), str(entry.get("id_cad", ""))
    category = category_of(catid)
    name = f"{SYNSETS.get(catid, catid or 'model')}_{number}"

    def broken(trouble: str) -> BrokenModel:
        return BrokenModel(name, category, catid, id_cad, f"{file}: {name} ({catid}/{id_cad}): {trouble}.")

    if not catid or not id_cad:
        return broken("it names no CAD model (catid_cad, id_cad)")
    cad_to_world, trouble = _matrix(entry.get("trs"))
    if trouble:
        return broken(f"{trouble}; mend or remove it")
    half_size, center = (_vector(entry.get(key), 3) for key in ("bbox", "center"))
    if half_size is None or center is None or not (half_size > 0).any():
        half_size = center = None
    sym = str(entry.get("sym", "__SYM_NONE"))
    return AlignedModel(name, category, catid, id_cad, world_to_scan @ cad_to_world, sym, half_size, center)


def _matrix(trs: Any) -> tuple[np.ndarray, str]:
    """Return the matrix of a `trs`, or the reason why it is invalid."""
    if not isinstance(trs, dict):
        return np.eye(4), "it has no trs"
    sizes = {"translation": 3, "rotation": 4, "scale": 3}
    values = {key: _vector(trs.get(key), size) for key, size in sizes.items()}
    for key, value in values.items():
        if value is None:
            return np.eye(4), f"its {key} is not {sizes[key]} finite numbers"
    translation, rotation, scale = (value for value in values.values() if value is not None)
    if (np.abs(scale) < _MIN_SCALE).any():
        return np.eye(4), f"its scale {scale.tolist()} has a zero"
    if np.linalg.norm(rotation) < _MIN_SCALE:
        return np.eye(4), "its rotation is a zero quaternion"
    return compose(translation, rotation, scale), ""


def _vector(value: Any, size: int) -> np.ndarray | None:
    try:
        vector = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        return None
    return vector if vector.shape == (size,) and np.isfinite(vector).all() else None
