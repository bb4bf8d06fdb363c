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
    *(
        "seating",
        "seating.bedframe",
        "tables",
        "shelves",
        "appliances",
        "appliances.toaster",
        "bathroom",
        "lamp",
        "elements",
        "elements.doors",
        "windows",
    ),
    *("elements.staircases", "table_decorations", "wall_decorations", "decor", "tableware"),
)
"""Modules of `infinigen.assets.objects` that hold the factories."""

LONG = (
    *("TableDiningFactory", "CoffeeTableFactory"),
    *("PanelDoorFactory", "GlassPanelDoorFactory", "LiteDoorFactory", "LouverDoorFactory", "WindowFactory"),
)
"""Made with their long side along the front's direction; here the long side is the front."""

UNITS = {"ToasterFactory": 0.1}
"""Metres of a unit, where it is another."""

SIMPLE = 60
"""Pieces of no more triangles than this keep them all."""

SPECK = 0.05
"""Smaller pieces, as a fraction of the longest side, are left out of shapes with too many triangles."""

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
    points = points * UNITS.get(factory, 1.0)
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
    """Dissolve flat neighbours, then collapse edges of pieces with many triangles, down to about `max_faces` in all."""
    import numpy as np

    if len(faces) <= max_faces:
        return vertices, faces
    item = _object(vertices, faces)
    item.modifiers.new("weld", "WELD").merge_threshold = 1e-5
    flat = item.modifiers.new("flat", "DECIMATE")
    flat.decimate_type, flat.angle_limit = "DISSOLVE", 0.03
    fewer = _result(item)
    if len(fewer[1]) > max_faces:
        fewer = _without_specks(*fewer)
    if len(fewer[1]) > max_faces:
        item = _object(*fewer)
        # A plain box beside fine grilles would be the first to lose its corners.
        item.vertex_groups.new(name="fine").add(_fine(*fewer), 1.0, "REPLACE")
        collapse = item.modifiers.new("fewer", "DECIMATE")
        collapse.ratio, collapse.vertex_group = max_faces / len(fewer[1]), "fine"
        collapsed = _result(item)
        # Where fine grilles cannot be made coarser, all the rest would be: a shape with many triangles is better.
        before, after = (np.ptp(one[0], axis=0) for one in (fewer, collapsed))
        if np.abs(after - before).max() < SPECK * before.max():
            return collapsed
    return fewer


def _object(vertices, faces):  # type: ignore[no-untyped-def]
    import bpy  # type: ignore[import-not-found, unused-ignore]

    mesh = bpy.data.meshes.new("joined")
    mesh.from_pydata(vertices.tolist(), [], faces.tolist())
    item = bpy.data.objects.new("joined", mesh)
    bpy.context.scene.collection.objects.link(item)
    return item


def _result(item):  # type: ignore[no-untyped-def]
    """Triangulate an object after its modifiers, and remove it."""
    import bpy  # type: ignore[import-not-found, unused-ignore]

    bpy.context.view_layer.update()
    found = _triangles(item)
    bpy.data.objects.remove(item)
    return found


def _pieces(vertices, faces):  # type: ignore[no-untyped-def]
    """Return the number of the piece, connected by edges, of each vertex and of each face."""
    import numpy as np
    from scipy.sparse import coo_matrix  # type: ignore[import-untyped, unused-ignore]
    from scipy.sparse.csgraph import connected_components  # type: ignore[import-untyped, unused-ignore]

    start, end = faces[:, [0, 1]].ravel(), faces[:, [1, 2]].ravel()
    edges = coo_matrix((np.ones(len(start)), (start, end)), shape=(len(vertices), len(vertices)))
    _, piece = connected_components(edges, directed=False)
    return piece, piece[faces[:, 0]]


def _fine(vertices, faces):  # type: ignore[no-untyped-def]
    """List the vertices of pieces with more than `SIMPLE` triangles."""
    import numpy as np

    piece, of_face = _pieces(vertices, faces)
    size = np.bincount(of_face, minlength=piece.max() + 1)
    return np.flatnonzero(size[piece] > SIMPLE).tolist()


def _without_specks(vertices, faces):  # type: ignore[no-untyped-def]
    """Leave out pieces smaller than `SPECK` of the longest side: letters, keys, screws."""
    import numpy as np

    piece, of_face = _pieces(vertices, faces)
    low = np.full((piece.max() + 1, 3), np.inf)
    high = -low
    np.minimum.at(low, piece, vertices)
    np.maximum.at(high, piece, vertices)
    large = (high - low).max(1) >= SPECK * (vertices.max(0) - vertices.min(0)).max()
    kept, faces = np.unique(faces[large[of_face]], return_inverse=True)
    return vertices[kept], faces.reshape(-1, 3)


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
