"""Runs in Infinigen's own Python: furniture of its factories by seed, as arrays in files; knows nothing of kpred.

    python worker.py FOLDER MAX_FACES FACTORY:SEED [FACTORY:SEED ...]

writes FOLDER/FACTORY_SEED.npz (vertices float32 (V, 3) in metres, y up, front +z, floor at y = 0; faces int32 (F, 3)),
each whole or not at all, and prints a line for each: `done NAME`, or `failed NAME why`.
"""

from __future__ import annotations

import contextlib
import io
import os
import sys
import traceback

MODULES = (
    *("seating", "tables", "shelves", "appliances", "bathroom", "lamp", "elements", "elements.doors", "windows"),
    *("elements.staircases", "table_decorations", "wall_decorations", "decor", "tableware"),
)
"""Modules of `infinigen.assets.objects` that hold the factories."""

LONG = ("TableDiningFactory", "CoffeeTableFactory")
"""Made with their long side along the front's direction; here the long side is the front."""

MISSING = 3
"""Exit code where infinigen or bpy cannot be imported."""


def make(factory: str, seed: int, max_faces: int):  # type: ignore[no-untyped-def]  # numpy of another environment
    """Make vertices and faces of one shape."""
    import importlib

    import bpy  # type: ignore[import-not-found, unused-ignore]
    import numpy as np

    for name in MODULES:
        module = importlib.import_module(f"infinigen.assets.objects.{name}")
        if hasattr(module, factory):
            break
    else:
        raise ValueError(f"there is no factory {factory}")
    bpy.ops.wm.read_factory_settings(use_empty=True)
    root = getattr(module, factory)(seed).spawn_asset(0)
    vertices, faces, count = [], [], 0
    for item in (root, *root.children_recursive):
        if item.type != "MESH":
            continue
        corners, triangles = _triangles(item)
        vertices.append(corners)
        faces.append(triangles + count)
        count += len(corners)
    points, triangles = _decimated(np.concatenate(vertices), np.concatenate(faces), max_faces)
    # Infinigen: z up, front +x. Here: y up, front +z.
    points = points[:, [1, 2, 0]]
    if factory in LONG:
        points = points[:, [2, 1, 0]] * [1, 1, -1]
    low, high = points.min(0), points.max(0)
    points = points - [(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2]
    return points.astype(np.float32), triangles.astype(np.int32)


def _triangles(item):  # type: ignore[no-untyped-def]
    """Triangulate the visible mesh of an object, in world coordinates."""
    import bpy  # type: ignore[import-not-found, unused-ignore]
    import numpy as np

    shown = item.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = shown.to_mesh()
    mesh.calc_loop_triangles()
    corners = np.empty(3 * len(mesh.vertices))
    mesh.vertices.foreach_get("co", corners)
    triangles = np.empty(3 * len(mesh.loop_triangles), np.int64)
    mesh.loop_triangles.foreach_get("vertices", triangles)
    shown.to_mesh_clear()
    matrix = np.array(item.matrix_world)
    return corners.reshape(-1, 3) @ matrix[:3, :3].T + matrix[:3, 3], triangles.reshape(-1, 3)


def _decimated(vertices, faces, max_faces):  # type: ignore[no-untyped-def]
    """Return dissolve flat neighbours, then collapse edges down to `max_faces` triangles."""
    import bpy  # type: ignore[import-not-found, unused-ignore]

    if len(faces) <= max_faces:
        return vertices, faces
    mesh = bpy.data.meshes.new("joined")
    mesh.from_pydata(vertices.tolist(), [], faces.tolist())
    item = bpy.data.objects.new("joined", mesh)
    bpy.context.scene.collection.objects.link(item)
    weld = item.modifiers.new("weld", "WELD")
    weld.merge_threshold = 1e-5
    flat = item.modifiers.new("flat", "DECIMATE")
    flat.decimate_type, flat.angle_limit = "DISSOLVE", 0.03
    bpy.context.view_layer.update()
    fewer = _triangles(item)
    if len(fewer[1]) > max_faces:
        item.modifiers.new("triangles", "TRIANGULATE")
        item.modifiers.new("fewer", "DECIMATE").ratio = max_faces / len(fewer[1])
        bpy.context.view_layer.update()
        fewer = _triangles(item)
    bpy.data.objects.remove(item)
    return fewer


def main(arguments: list[str]) -> int:
    """Make all jobs; one failure does not stop the rest."""
    folder, max_faces, jobs = arguments[0], int(arguments[1]), arguments[2:]
    # Infinigen and Blender print what they like; standard output is for the results.
    results = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)
    try:
        import bpy  # noqa: F401
        import infinigen  # type: ignore[import-not-found, unused-ignore]  # noqa: F401
        import numpy as np
    except ImportError as error:
        print(f"missing {error}", file=results)
        return MISSING
    for job in jobs:
        factory, _, seed = job.partition(":")
        name = f"{factory}_{seed}"
        try:
            with contextlib.redirect_stdout(io.StringIO()):
                vertices, faces = make(factory, int(seed), max_faces)
        except Exception as error:  # an asset may fail in any way
            traceback.print_exc()
            print(f"failed {name} {type(error).__name__}: {' '.join(str(error).split())[:200]}", file=results)
            continue
        scratch = os.path.join(folder, f".{name}.{os.getpid()}.npz")
        np.savez_compressed(scratch, vertices=vertices, faces=faces)
        os.replace(scratch, os.path.join(folder, f"{name}.npz"))
        print(f"done {name}", file=results)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
