"""Nodes of a scene's GLB: each result with its model's materials or one plain colour, and points without a model."""

from __future__ import annotations

import io

import numpy as np
import trimesh

from kpred.fitting.result import Fit
from kpred.ops.typing import Float, Int
from kpred.scenes.scene import Scene
from kpred.shapes.appearance.write import appearance_files

POINTS_NODE = "unexplained_points"
"""Node of the points that belong to no object, floor, wall or ceiling."""

MAX_POINTS = 200_000
"""Points of that node; more are thinned evenly."""

OBJECT_COLORS = (
    *((111, 159, 216), (226, 137, 88), (122, 178, 122), (196, 122, 178), (214, 186, 92)),
    *((108, 180, 182), (201, 108, 104), (142, 134, 206), (160, 140, 118), (150, 190, 90)),
)
"""(R, G, B) of the objects in the GLB and in the picture, in turn."""

_GREY = (150, 158, 168)


def add_result(
    scene: trimesh.Scene,
    parent: str,
    node: str,
    fit: Fit,
    mesh: trimesh.Trimesh,
    transform: Float[np.ndarray, "4 4"],
    number: int,
) -> None:
    """Add a result below `parent`: one mesh on `node`, or, of several materials, one on a node each below it.

    Args:
        mesh: the deformed mesh in the node's own frame; transform: from there to the parent's; number: of its colour.

    Raises:
        DatabaseError: the model's materials cannot be read.
    """
    surfaces = _with_materials(fit, mesh)
    if len(surfaces) <= 1:
        surface = surfaces[0] if surfaces else _plain(mesh, node, OBJECT_COLORS[number % len(OBJECT_COLORS)])
        scene.add_geometry(surface, node_name=node, geom_name=node, parent_node_name=parent, transform=transform)
        return
    scene.graph.update(frame_to=node, frame_from=parent, matrix=transform)
    for part, surface in enumerate(surfaces):
        name = f"{node} {part}"
        scene.add_geometry(surface, node_name=name, geom_name=name, parent_node_name=node)


def add_points(scene: trimesh.Scene, parent: str, scan: Scene, rows: Int[np.ndarray, " points"]) -> None:
    """Add rows of a scan's points below `parent`, with their colours."""
    if not len(rows):
        return
    chosen = rows[:: max(1, -(-len(rows) // MAX_POINTS))]
    colors = np.tile(_GREY, (len(chosen), 1)) if scan.colors is None else scan.colors[chosen]
    opaque = np.column_stack([colors, np.full(len(chosen), 255)]).astype(np.uint8)
    cloud = trimesh.PointCloud(scan.points[chosen], colors=opaque)
    scene.add_geometry(cloud, node_name=POINTS_NODE, geom_name=POINTS_NODE, parent_node_name=parent)


def _with_materials(fit: Fit, mesh: trimesh.Trimesh) -> list[trimesh.Trimesh]:
    """Return the surfaces of each of the model's materials, as `kpred fit` writes them; none where none are kept."""
    appearance = fit.read_appearance()
    if appearance is None:
        return []
    source = np.asarray(fit.placed.entry.mesh.vertices, dtype=np.float64)
    result = np.asarray(mesh.vertices, dtype=np.float64)
    data = appearance_files(appearance, source, result, "model.glb", fit.credit)["model.glb"]
    loaded = trimesh.load_scene(io.BytesIO(data), file_type="glb", process=False)
    surfaces = []
    for node in loaded.graph.nodes_geometry:
        matrix, geometry = loaded.graph[node]
        found = loaded.geometry[geometry]
        if isinstance(found, trimesh.Trimesh):
            surfaces.append(found.copy().apply_transform(matrix))
    return surfaces


def _plain(mesh: trimesh.Trimesh, name: str, color: tuple[int, int, int]) -> trimesh.Trimesh:
    material = trimesh.visual.material.PBRMaterial(
        name=name, baseColorFactor=[*color, 255], metallicFactor=0.0, roughnessFactor=0.8, doubleSided=True
    )
    mesh.visual = trimesh.visual.TextureVisuals(material=material)
    return mesh
