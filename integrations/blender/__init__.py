"""Blender add-on: select a point cloud, press *Fit*, and a CAD model with its materials stands in its place.

kpred runs as a process of its own, so that Blender's Python needs nothing but Blender.
"""

from __future__ import annotations

import json
import subprocess
import tempfile
from pathlib import Path

import bpy
import numpy as np

UP_AXES = ("auto", "x", "y", "z", "-x", "-y", "-z")
MIN_POINTS = 64
INTERVAL = 0.2
"""Seconds between looks at the process."""


class FitError(Exception):
    """A fit that is not possible, as one sentence."""


class KpredPreferences(bpy.types.AddonPreferences):
    """Where kpred is, and the database."""

    bl_idname = __package__ or __name__

    interpreter: bpy.props.StringProperty(
        name="Python with kpred",
        description="Interpreter of the environment in which kpred is installed, such as .venv/bin/python",
        subtype="FILE_PATH",
        default="",
    )
    database: bpy.props.StringProperty(
        name="Database",
        description="CAD database (.kpred); empty: the one that comes with kpred",
        subtype="FILE_PATH",
        default="",
    )

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the fields."""
        self.layout.prop(self, "interpreter")
        self.layout.prop(self, "database")


class KpredSettings(bpy.types.PropertyGroup):
    """Options of the next fit."""

    up: bpy.props.EnumProperty(
        name="Up", items=[(axis, axis, "") for axis in UP_AXES], default="z", description="Up axis of the scan, world"
    )
    category: bpy.props.StringProperty(
        name="Category", description="chair, table, cabinet, ...; empty: the one that fits best", default=""
    )


class OBJECT_OT_kpred_fit(bpy.types.Operator):
    """Fit a CAD model to the vertices of the active object."""

    bl_idname = "object.kpred_fit"
    bl_label = "Fit"
    bl_description = "Fit a CAD model to the vertices of the active object, in its place"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether the active object has points."""
        return context.object is not None and context.object.type in ("MESH", "POINTCLOUD")

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Fit and wait, as scripts need it."""
        try:
            self._begin(context)
            self._process.wait()
            self._finish(context)
        except FitError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return {"FINISHED"}

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Fit while Blender goes on."""
        if bpy.app.background:
            return self.execute(context)
        try:
            self._begin(context)
        except FitError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        manager = context.window_manager
        self._timer = manager.event_timer_add(INTERVAL, window=context.window)
        manager.modal_handler_add(self)
        context.workspace.status_text_set("kpred is fitting; Esc stops it")
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Look whether the process has ended."""
        if event.type == "ESC":
            self._process.kill()
            self._end(context)
            self._folder.cleanup()
            return {"CANCELLED"}
        if event.type != "TIMER" or self._process.poll() is None:
            return {"PASS_THROUGH"}
        self._end(context)
        try:
            self._finish(context)
        except FitError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return {"FINISHED"}

    def _begin(self, context: bpy.types.Context) -> None:
        """Write the scan and start kpred."""
        preferences = context.preferences.addons[KpredPreferences.bl_idname].preferences
        interpreter = Path(bpy.path.abspath(preferences.interpreter)) if preferences.interpreter else None
        if interpreter is None or not interpreter.is_file():
            raise FitError("Set the Python with kpred in the preferences of this add-on.")
        points = world_points(context.object, context.evaluated_depsgraph_get())
        if len(points) < MIN_POINTS:
            raise FitError(f"{context.object.name} has {len(points)} points; a fit needs at least {MIN_POINTS}.")
        self._name = context.object.name
        self._folder = tempfile.TemporaryDirectory(prefix="kpred-blender-")
        folder = Path(self._folder.name)
        # In metres, as GLB is, from which Blender reads the result in the scene's unit.
        np.save(folder / "scan.npy", points * context.scene.unit_settings.scale_length)
        database = bpy.path.abspath(preferences.database) if preferences.database else ""
        command = fit_command(interpreter, folder, context.scene.kpred, database)
        self._log = (folder / "log.txt").open("w+", encoding="utf-8")
        self._process = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=self._log, cwd=folder
        )  # fmt: skip

    def _finish(self, context: bpy.types.Context) -> None:
        """Read the result."""
        folder = Path(self._folder.name)
        try:
            self._log.seek(0)
            said = self._log.read().strip().splitlines()
            self._log.close()
            if self._process.returncode != 0:
                raise FitError(said[-1] if said else f"kpred ended with {self._process.returncode}.")
            record = json.loads((folder / "result.json").read_text(encoding="utf-8"))
            place(context, import_glb(folder / "result.glb"), f"{self._name} fit", record)
        finally:
            self._folder.cleanup()
        self.report({"INFO"}, f"{record['model_id']} ({record['category']}), confidence {record['confidence']:.2f}")
        for warning in record["warnings"]:
            self.report({"WARNING"}, warning)

    def _end(self, context: bpy.types.Context) -> None:
        context.window_manager.event_timer_remove(self._timer)
        context.workspace.status_text_set(None)


class VIEW3D_PT_kpred(bpy.types.Panel):
    """Panel *kpred* in the sidebar of the 3D view."""

    bl_label = "Scan to CAD"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "kpred"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw options and button."""
        settings = context.scene.kpred
        self.layout.prop(settings, "up")
        self.layout.prop(settings, "category")
        self.layout.operator(OBJECT_OT_kpred_fit.bl_idname)


def world_points(item: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> np.ndarray:
    """Return the points (N, 3) of an object with its modifiers, in the world's coordinates."""
    shown = item.evaluated_get(depsgraph)
    if item.type == "POINTCLOUD":
        positions = shown.data.attributes["position"].data
        flat = np.empty(3 * len(positions), dtype=np.float32)
        positions.foreach_get("vector", flat)
    else:
        flat = np.empty(3 * len(shown.data.vertices), dtype=np.float32)
        shown.data.vertices.foreach_get("co", flat)
    matrix = np.array(shown.matrix_world, dtype=np.float64)
    return flat.reshape(-1, 3).astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]


def fit_command(interpreter: Path, folder: Path, settings: KpredSettings, database: str) -> list[str]:
    """Return the command that fits `scan.npy` of a folder."""
    command = [str(interpreter), "-m", "kpred", "fit", str(folder / "scan.npy"), "-o", str(folder / "result.glb")]
    command += ["--up", settings.up, "--unit", "m", "--no-picture"]
    if settings.category.strip():
        command += ["--category", settings.category.strip()]
    return command + (["--database", database] if database else [])


def import_glb(file: Path) -> list[bpy.types.Object]:
    """Read a GLB, and return the objects without a parent."""
    before = set(bpy.data.objects)
    bpy.ops.import_scene.gltf(filepath=str(file))
    return [item for item in bpy.data.objects if item not in before and item.parent is None]


def place(context: bpy.types.Context, roots: list[bpy.types.Object], name: str, record: dict[str, object]) -> None:
    """Name a result and select it; its facts become custom properties."""
    for item in context.selected_objects:
        item.select_set(False)
    for root in roots:
        root.name = name
        for key in ("model_id", "category", "confidence", "licence"):
            root[f"kpred_{key}"] = record[key]
        root.select_set(True)
        context.view_layer.objects.active = root


CLASSES = (KpredPreferences, KpredSettings, OBJECT_OT_kpred_fit, VIEW3D_PT_kpred)


def register() -> None:
    """Add everything to Blender."""
    for one in CLASSES:
        bpy.utils.register_class(one)
    bpy.types.Scene.kpred = bpy.props.PointerProperty(type=KpredSettings)


def unregister() -> None:
    """Remove everything from Blender."""
    del bpy.types.Scene.kpred
    for one in reversed(CLASSES):
        bpy.utils.unregister_class(one)
