"""A whole scene: every object fitted, and the results put together in the scene's own frame."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from kpred.database import Database
from kpred.errors import ConfigError, KpredError, OutputError, ScanError
from kpred.fitting.defaults import resolve_database, resolve_model, shared_categories
from kpred.fitting.object_fit import ObjectFit
from kpred.fitting.pipeline import fit
from kpred.fitting.scene_nodes import add_points, add_result
from kpred.nn import Model
from kpred.ops.rotations import upright_rotation
from kpred.scenes.floor import SceneFloor, find_floor
from kpred.scenes.objects import SceneObject
from kpred.scenes.scan2cad import AlignedModel, results, write_csv
from kpred.scenes.scan2cad_pool import with_pool_models
from kpred.scenes.scene import Scene
from kpred.shapes.mesh_io import write_mesh

SCAN_NODE = "scan_frame"
"""Node of the GLB below which everything is in the scan's own frame and units."""


@dataclass(frozen=True, eq=False)
class SceneFit:
    """The fits of a scene's objects.

    Attributes:
        scene: the scan; fits: in the objects' order; floor: what they stand on, if it was found.
        leveling: (3, 3) rotation that makes a tilted scan stand upright along the scene's up axis.
        unexplained: rows of the scene's points that are written as points: of no object, floor, wall or ceiling.
    """

    scene: Scene
    fits: tuple[ObjectFit, ...]
    floor: SceneFloor | None = None
    leveling: np.ndarray = field(default_factory=lambda: np.eye(3))
    unexplained: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))

    @property
    def fitted(self) -> tuple[ObjectFit, ...]:
        """Those that have a fit."""
        return tuple(item for item in self.fits if item.fit is not None)

    def scan_to_glb(self) -> np.ndarray:
        """Return the rotation (4, 4) of the scan's up direction to +y, as in glTF."""
        matrix = np.eye(4)
        matrix[:3, :3] = upright_rotation(self.scene.up) @ self.leveling
        return matrix

    def glb_scene(self) -> trimesh.Scene:
        """Build a scene with one named node per object (`Alignment.node`), y up, in the scan's unit.

        Meshes are in ShapeNet's frame (`ObjectFit.cad_mesh`), with the materials of their models; nodes carry
        `cad_to_scan` and stand below `scan_frame`, which carries `scan_to_glb`. Points that nothing explains have a
        node of their own.
        """
        result = trimesh.Scene()
        result.graph.update(frame_to=SCAN_NODE, frame_from=result.graph.base_frame, matrix=self.scan_to_glb())
        for number, item in enumerate(self.fitted):
            assert item.fit is not None
            add_result(result, SCAN_NODE, item.node, item.fit, item.cad_mesh(), item.cad_to_scan(), number)
        add_points(result, SCAN_NODE, self.scene, self.unexplained)
        return result

    def to_glb(self, path: str | os.PathLike[str]) -> None:
        """Write `glb_scene` as one .glb, whole or not at all.

        Raises:
            OutputError: another extension, no object was fitted, or the file cannot be written there.
        """
        file = Path(path)
        if file.suffix.lower() != ".glb":
            raise OutputError(f"Cannot write {file}: scenes are .glb files; give it that extension.")
        if not self.fitted:
            raise OutputError(f"Cannot write {file}: no object of the scene was fitted, so it would be empty.")
        write_mesh(file, self.glb_scene())

    def save(self, path: str | os.PathLike[str]) -> list[Path]:
        """Write the scene in the format of the extension (`kpred.fitting.scene_export`), and return the files.

        Raises:
            OutputError: the format holds one object, its library is not installed, no object was fitted, or a file
                cannot be written there.
        """
        from kpred.fitting.scene_export import save_scene

        return save_scene(self, path)

    def show(self, path: str | os.PathLike[str] | None = None) -> Path:
        """Write the report of the room, open it in the browser, and return its file.

        Args:
            path: of the page (.html); None makes a temporary file.

        Raises:
            OutputError: another extension, or the file cannot be written there.
        """
        # Reports and pictures stand on higher floors: loaded by name, and only when needed.
        shown: Path = import_module("kpred.reports.room_report").show_room(self, path)
        return shown

    def _repr_html_(self) -> str:
        """Return what notebooks show: the picture and a table of the objects as HTML."""
        html: str = import_module("kpred.rendering.page").room_html(self)
        return html

    def to_csv(self, path: str | os.PathLike[str], pool: Sequence[AlignedModel] | None = None) -> None:
        """Write the alignments as Scan2CAD's benchmark reads them (`kpred.scenes.scan2cad.write_csv`).

        Args:
            pool: annotated models that stand for the results (`kpred.scenes.scan2cad_pool.with_pool_models`).
        """
        alignments = [item.alignment() for item in self.fitted]
        write_csv(path, alignments if pool is None else with_pool_models(alignments, pool))

    def to_json(self, mesh: str = "") -> dict[str, Any]:
        """Return everything but the meshes, as plain values; `mesh` names the GLB in Scan2CAD's entries.

        `scan2cad` is a list of one scene in the form of `full_annotations.json`: its world is that of the GLB.
        """
        alignments = [item.alignment(mesh) for item in self.fitted]
        return {
            "scene": self.scene.name,
            "up": self.scene.up,
            "scan_to_glb": self.scan_to_glb().tolist(),
            "floor": _floor_described(self.floor),
            "leveling": self.leveling.tolist(),
            "unexplained_points": len(self.unexplained),
            "fitted": len(self.fitted),
            "objects": [item.to_json() for item in self.fits],
            "scan2cad": [results(self.scene.name, alignments, self.scan_to_glb())],
        }


def fit_scene(
    scene: Scene,
    objects: Sequence[SceneObject],
    model: Model | str | os.PathLike[str] | None = None,
    database: Database | str | os.PathLike[str] | None = None,
    progress: Callable[[int, int, str], None] | None = None,
    floor: SceneFloor | bool = True,
    **fit_options: Any,
) -> SceneFit:
    """Fit every object of a scene whose category the model and the database know.

    An object without a category is fitted with the category that explains it best. What goes wrong with one object is
    stored in its `ObjectFit.error` and never stops the others.

    Args:
        scene: the scene; objects: what stands in it (`kpred.scenes.objects.objects_of`).
        model: trained networks, or their name or folder; None means bundled.
        database: open database or its path; None means bundled.
        progress: called with objects done, objects in all, and the name of the one that comes next ("" at the end).
        floor: what furniture stands on, also where its feet were not scanned; True finds it, False leaves it out.
        fit_options: further arguments of `kpred.fitting.fit`; `category` and `up` come from the objects.

    Raises:
        ScanError: if there are no objects.
        ModelError, DatabaseError: if they are missing, or the database was made by other weights.
        ConfigError: if `category` or `up` is among the options.
    """
    if not objects:
        raise ScanError(f"{scene.name}: the scene has no objects; nothing can be fitted.")
    for name in ("category", "up"):
        if name in fit_options:
            raise ConfigError(f"{name} is given by the scene's objects; leave the option out.")
    networks, store = resolve_model(model), resolve_database(database)
    shared_categories(networks, store, None)
    known = tuple(name for name in store.categories() if name in networks)
    if isinstance(floor, bool):
        ground = find_floor(scene, objects) if floor else None
    else:
        ground = floor
    done: list[ObjectFit] = []
    for item in objects:
        if progress is not None:
            progress(len(done), len(objects), item.name)
        done.append(_fit_object(item, networks, store, known, ground, fit_options))
    if progress is not None:
        progress(len(done), len(objects), "")
    return SceneFit(scene, tuple(done), ground)


def _fit_object(
    item: SceneObject,
    model: Model,
    database: Database,
    known: tuple[str, ...],
    ground: SceneFloor | None,
    options: dict[str, Any],
) -> ObjectFit:
    if item.problem is not None:
        return ObjectFit(item, error=item.problem)
    if item.category is not None and item.category not in known:
        why = f"{item.name}: {item.category} is not among the categories of model and database ({', '.join(known)})."
        return ObjectFit(item, error=why, skipped=True)
    floor = ground.height_under(item.points) if ground is not None and ground.carries(item.points) else None
    try:
        found = fit(item.points, model, database, category=item.category, up=item.up, floor=floor, **options)
        return ObjectFit(item, found, floor=floor)
    except KpredError as error:
        return ObjectFit(item, error=f"{item.name}: {str(error).removeprefix('scan: ')}")
    except Exception as error:  # One object must not cost the others their results.
        return ObjectFit(item, error=f"{item.name}: unexpected {type(error).__name__}: {' '.join(str(error).split())}")


def _floor_described(floor: SceneFloor | None) -> dict[str, Any] | None:
    if floor is None:
        return None
    return {"source": floor.source, "level": floor.level, "slope": floor.slope.tolist()}
