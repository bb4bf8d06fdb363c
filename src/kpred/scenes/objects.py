"""The objects of a scanned scene: from instance labels, boxes, ScanNet's segments or Scan2CAD's annotation."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from kpred.errors import ScanError
from kpred.scenes.boxes import annotated_members, arkit_boxes, box_label, box_members, labelcloud_box
from kpred.scenes.instances import instance_numbers
from kpred.scenes.scan2cad import AlignedModel, SceneAnnotation, read_json
from kpred.scenes.scene import Scene
from kpred.scenes.segments import segment_numbers
from kpred.shapes.categories import NYU40, STRUCTURE, category_of
from kpred.shapes.formats.scan_text import text_points
from kpred.shapes.reading import reading

_SAME_PLACE = 1e-4
_CLASS_STEP = 1000
"""ScanNet's benchmark files write class times 1000 plus instance."""


@dataclass(frozen=True, eq=False)
class SceneObject:
    """One object of a scene.

    Attributes:
        name: unique within the scene.
        category: as `category_of` gives it; None where nothing names it.
        points: (M, 3) float64 in the scene's frame and units, all finite.
        indices: (M,) rows of the scene's points; -1 for a point that the scene does not hold.
        up: the scene's up axis.
        annotation: the CAD model that Scan2CAD's annotators put there.
        problem: why the object cannot be used, a sentence that names it; None where nothing is wrong.
        score: how surely it is one object of its category, where it was detected, in [0, 1].
    """

    name: str
    category: str | None
    points: np.ndarray
    indices: np.ndarray
    up: str = "z"
    annotation: AlignedModel | None = None
    problem: str | None = None
    score: float | None = None


def objects_of(scene: Scene, file: str | os.PathLike[str] | None = None) -> list[SceneObject]:
    """Read the objects of a scene, in the file's order.

    `file` is one of:
    - instance numbers of all points: .npy, .npz (array `instances`, `instance` or `labels`, or the only one), .txt, or
      a .ply with a property such as `instance`. Negative numbers are no object; neither is 0 where none is negative.
      Categories come from the scene's NYU40 labels by majority, or from numbers of the form class * 1000 + instance;
    - the `segGroups` of ScanNet's `*.aggregation.json`, of ScanNet++'s `segments_anno.json` or of 3RScan, with their
      segments (`*.segs.json`, `segments.json`) beside them or beside the scene;
    - ARKitScenes' `*_3dod_annotation.json`: its oriented boxes; Replica's `info_semantic.json`: names of instances;
    - Scan2CAD's `full_annotations.json`: the points in and around the placed CAD model's box that are, where the scene
      has labels, of its class;
    - boxes: a JSON list of objects with `center`, `size` and `yaw` (radians about the up axis) or `axes`, or with
      `corners` (two opposite ones, or eight), or RoomPlan's `dimensions` and `transform`, and `name` and `category`
      where known; points labelled wall, floor or ceiling are left out;
    - S3DIS's `Annotations` folder with one .txt of points an object.
    None takes the instance numbers in the scene's own PLY, of its vertices or of its faces (Replica).

    An error of one object (no points, a broken transform) is stored in its `problem`; the others are not affected.

    Raises:
        ScanError: the file is missing, unreadable or of no known kind, its labels do not match the scene's points, or
            it has no objects at all.
    """
    source = None if file is None else Path(file)
    if source is None:
        if scene.instances is None:
            raise ScanError(f"{scene.path or scene.name}: its points have no instance numbers; give a file of objects.")
        objects = _from_instances(scene, scene.instances)
    else:
        with reading(source, ScanError, "file of objects"):
            objects = _from_file(scene, source)
    if not objects:
        raise ScanError(f"{source or scene.path or scene.name}: it has no objects; nothing can be fitted.")
    return _uniquely_named(objects)


def _from_file(scene: Scene, source: Path) -> list[SceneObject]:
    if source.is_dir():
        return _from_folder(scene, source)
    if not source.exists():
        raise ScanError(f"{source}: there is no such file of objects; check the path.")
    if source.suffix.lower() == ".json":
        return _from_json(scene, source)
    return _from_instances(scene, instance_numbers(source, len(scene.points)))


def _object(
    scene: Scene, name: str, category: str | None, members: np.ndarray, annotation: AlignedModel | None, where: str
) -> SceneObject:
    """Build the object of these rows; `members` are row numbers or a mask of the scene's points."""
    rows = np.flatnonzero(members) if members.dtype == bool else members
    rows = rows[np.isfinite(scene.points[rows]).all(axis=1)]
    problem = None if len(rows) else f"{name}: no point of the scan {where}."
    return SceneObject(name, category, scene.points[rows], rows, scene.up, annotation, problem)


def _broken(scene: Scene, name: str, category: str | None, problem: str) -> SceneObject:
    nothing = np.zeros(0, dtype=np.int64)
    return SceneObject(name, category, np.zeros((0, 3)), nothing, scene.up, None, problem)


def _uniquely_named(objects: list[SceneObject]) -> list[SceneObject]:
    taken: set[str] = set()
    result = []
    for item in objects:
        name, number = item.name, 2
        while name in taken:
            name, number = f"{item.name}_{number}", number + 1
        taken.add(name)
        result.append(item if name == item.name else SceneObject(**{**item.__dict__, "name": name}))
    return result


def _from_instances(scene: Scene, numbers: np.ndarray) -> list[SceneObject]:
    none_negative = numbers.min(initial=0) >= 0
    inside = numbers > 0 if none_negative else numbers >= 0
    values = np.unique(numbers[inside])
    coded = bool(len(values)) and bool((values >= _CLASS_STEP).all() and (values < len(NYU40) * _CLASS_STEP).all())
    objects = []
    for value in values.tolist():
        members = numbers == value
        category = None
        if scene.labels is not None:
            category = _label_name(np.bincount(scene.labels[members].clip(0, len(NYU40) - 1)).argmax())
        if category is None and coded:
            category = _label_name(value // _CLASS_STEP)
        objects.append(_object(scene, f"{category or 'object'}_{value}", category, members, None, "has its number"))
    return objects


def _label_name(number: int | np.integer) -> str | None:
    return category_of(NYU40[int(number)]) if number else None


def _from_json(scene: Scene, file: Path) -> list[SceneObject]:
    content = read_json(file)
    if isinstance(content, dict) and "segGroups" in content:
        return _from_segments(scene, file, content)
    first = content[0] if isinstance(content, list) and content else content
    if isinstance(first, dict) and "aligned_models" in first:
        return _from_annotation(scene, file)
    if isinstance(content, dict) and isinstance(content.get("data"), list):
        return _from_boxes(scene, file, arkit_boxes(content["data"]))
    if isinstance(content, dict):
        content = next((content[key] for key in ("objects", "boxes", "bboxes") if key in content), None)
    if scene.instances is not None and isinstance(content, list) and _names_instances(content):
        return _from_names(scene, scene.instances, content)
    if not isinstance(content, list):
        raise ScanError(f"{file}: it holds no objects; give boxes, a ScanNet aggregation or a Scan2CAD annotation.")
    return _from_boxes(scene, file, content)


def _names_instances(entries: list[Any]) -> bool:
    """Test whether these are names of instances, as in Replica's info_semantic.json."""
    return bool(entries) and all(
        isinstance(entry, dict) and "id" in entry and "class_name" in entry for entry in entries
    )


def _from_names(scene: Scene, numbers: np.ndarray, entries: list[dict[str, Any]]) -> list[SceneObject]:
    objects = []
    for entry in entries:
        label, number = str(entry["class_name"]), entry["id"]
        category = category_of(label) if label.strip() else None
        members = numbers == number if isinstance(number, int) else np.zeros(len(numbers), dtype=bool)
        objects.append(_object(scene, f"{category or 'object'}_{number}", category, members, None, "has its number"))
    return objects


def _from_boxes(scene: Scene, file: Path, boxes: Sequence[Any]) -> list[SceneObject]:
    structure = [NYU40.index(name) for name in STRUCTURE]
    apart = np.zeros(len(scene.points), bool) if scene.labels is None else np.isin(scene.labels, structure)
    objects = []
    for number, item in enumerate(boxes):
        box = (labelcloud_box(item) or item) if isinstance(item, dict) else {"corners": item}
        label = box_label(box)
        category = None if label is None else category_of(label)
        name = str(box.get("name") or f"{category or 'object'}_{number}")
        members = box_members(scene.points, scene.up, box)
        if isinstance(members, str):
            objects.append(_broken(scene, name, category, f"{file}: the box of {name} is broken: {members}."))
        else:
            objects.append(_object(scene, name, category, members & ~apart, None, "lies in its box"))
    return objects


def _from_segments(scene: Scene, file: Path, content: Mapping[str, Any]) -> list[SceneObject]:
    segments = segment_numbers(scene, file, str(content.get("segmentsFile", "")))
    objects = []
    groups = content["segGroups"] if isinstance(content["segGroups"], list) else []
    for number, group in enumerate(groups):
        label = str(group.get("label", "")) if isinstance(group, dict) else ""
        category = category_of(label) if label else None
        name = f"{category or 'object'}_{group.get('objectId', number) if isinstance(group, dict) else number}"
        wanted = group.get("segments") if isinstance(group, dict) else None
        if not isinstance(wanted, list) or not all(isinstance(value, int) and abs(value) < 2**62 for value in wanted):
            objects.append(_broken(scene, name, category, f"{file}: {name} has no list of segments."))
        else:
            objects.append(_object(scene, name, category, np.isin(segments, wanted), None, "is in its segments"))
    return objects


def _from_annotation(scene: Scene, file: Path) -> list[SceneObject]:
    annotation = annotation_of(scene, file)
    members = annotated_members(scene, annotation.models)
    objects = [
        _object(scene, model.name, model.category, rows, model, f"of its class lies in the box of {model.id_cad}")
        if isinstance(rows, np.ndarray)
        else _broken(scene, model.name, model.category, f"{file}: {rows}")
        for model, rows in zip(annotation.models, members, strict=True)
    ]
    objects += [_broken(scene, broken.name, broken.category, broken.reason) for broken in annotation.broken]
    # Names end in the number of the model in the file.
    return sorted(objects, key=lambda item: int(item.name.rpartition("_")[2]))


def annotation_of(scene: Scene, file: str | os.PathLike[str]) -> SceneAnnotation:
    """Read the annotation of this scene in a `full_annotations.json`, by name or as the only one.

    Raises:
        ScanError: the file is no annotation, or has only other scenes.
    """
    from kpred.scenes.scan2cad import read_annotations

    found = read_json(Path(file))
    names = [str(entry.get("id_scan")) for entry in (found if isinstance(found, list) else [found])]
    if scene.name in names:
        return read_annotations(file, scene.name)[0]
    if len(names) != 1 or (scene.name.startswith("scene") and names[0].startswith("scene")):
        raise ScanError(f"{file}: it has no annotation of {scene.name}; give the file that holds that scene.")
    return read_annotations(file)[0]


def _from_folder(scene: Scene, folder: Path) -> list[SceneObject]:
    files = sorted(file for file in folder.glob("*.txt") if not file.name.startswith(".") and file.is_file())
    finite = np.flatnonzero(np.isfinite(scene.points).all(axis=1))
    tree = cKDTree(scene.points[finite])
    objects = []
    for file in files:
        category = category_of(file.stem.rpartition("_")[0] or file.stem)
        try:
            with reading(file, ScanError):
                points = np.concatenate([np.zeros((0, 3)), *text_points(file)])
        except ScanError as error:
            objects.append(_broken(scene, file.stem, category, str(error)))
            continue
        points = points[np.isfinite(points).all(axis=1)]
        distance, nearest = tree.query(points, distance_upper_bound=_SAME_PLACE)
        rows = np.where(np.isfinite(distance), finite[np.minimum(nearest, len(finite) - 1)], -1)
        problem = None if len(points) else f"{file}: it has no points."
        objects.append(SceneObject(file.stem, category, points, rows, scene.up, None, problem))
    return objects
