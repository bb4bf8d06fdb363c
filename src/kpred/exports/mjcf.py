"""MJCF of MuJoCo: free bodies above a floor, in one file without meshes beside it."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as Xml

import numpy as np

from kpred.exports.bodies import Body, Collider, bodies_of
from kpred.exports.furniture import Export, Furniture
from kpred.exports.surfaces import surfaces_of
from kpred.exports.writer import Writer, bytes_writer
from kpred.exports.xml_text import numbers, quaternion, xml_bytes, xml_comment, xml_name


def mjcf_writers(export: Export, path: Path) -> dict[Path, Writer]:
    """Return the one file: metres, z up; colliders by part in group 3, surfaces that are only seen in group 2."""
    root = Xml.Element("mujoco", model=xml_name(path.stem))
    for furniture in export.objects:
        root.append(xml_comment(furniture.credit.lines()))
    default = Xml.SubElement(root, "default")
    seen = Xml.SubElement(default, "default", {"class": "visual"})
    Xml.SubElement(seen, "geom", type="mesh", contype="0", conaffinity="0", group="2", mass="0")
    solid = Xml.SubElement(default, "default", {"class": "collider"})
    Xml.SubElement(solid, "geom", group="3", rgba="0.4 0.6 0.9 0.4")
    assets, world = Xml.SubElement(root, "asset"), Xml.SubElement(root, "worldbody")
    bodies = bodies_of(export)
    middle = np.mean([body.pose[:2, 3] for body in bodies], axis=0)
    height = min(body.floor() for body in bodies)
    Xml.SubElement(world, "light", pos=numbers([*middle, height + 4]), dir="0 0 -1")
    Xml.SubElement(
        world, "geom", name="floor", type="plane", size="0 0 0.05", pos=numbers([*middle, height]), rgba=".9 .9 .9 1"
    )
    for furniture, body in zip(export.objects, bodies, strict=True):
        _add_body(export, furniture, body, assets, world)
    return {path: bytes_writer(xml_bytes(root))}


def _add_body(export: Export, furniture: Furniture, body: Body, assets: Xml.Element, world: Xml.Element) -> None:
    name = xml_name(body.name)
    element = Xml.SubElement(
        world, "body", name=name, pos=numbers(body.pose[:3, 3]), quat=numbers(quaternion(body.pose[:3, :3]))
    )
    Xml.SubElement(element, "freejoint", name=f"{name}_joint")
    tensor = body.inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    Xml.SubElement(element, "inertial", pos=numbers(body.center), mass=f"{body.mass:.9g}", fullinertia=numbers(tensor))
    for number, surface in enumerate(surfaces_of(furniture, export.scan_to_body(furniture))):
        mesh = f"{name}_surface_{number}"
        used, faces = np.unique(surface.faces, return_inverse=True)
        if len(used) < 4:
            continue  # MuJoCo takes no single triangles.
        _add_mesh(assets, mesh, surface.vertices[used], faces.reshape(-1, 3), "shell")
        Xml.SubElement(element, "geom", {"class": "visual"}, mesh=mesh, rgba=numbers(surface.material.color))
    for number, collider in enumerate(body.colliders):
        _add_collider(collider, f"{name}_part_{number}", assets, element)


def _add_collider(collider: Collider, name: str, assets: Xml.Element, body: Xml.Element) -> None:
    if collider.hull is None:
        Xml.SubElement(
            body,
            "geom",
            {"class": "collider"},
            name=name,
            type="box",
            pos=numbers(collider.center),
            quat=numbers(quaternion(collider.rotation)),
            size=numbers(collider.size / 2),
        )
        return
    _add_mesh(assets, name, *collider.hull, "convex")
    Xml.SubElement(body, "geom", {"class": "collider"}, name=name, type="mesh", mesh=name)


def _add_mesh(assets: Xml.Element, name: str, vertices: np.ndarray, faces: np.ndarray, inertia: str) -> None:
    Xml.SubElement(
        assets,
        "mesh",
        name=name,
        vertex=numbers(vertices.ravel()),
        face=" ".join(map(str, faces.ravel().tolist())),
        inertia=inertia,
    )
