"""SDF of Gazebo: a model for each object, meshes beside the file."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as Xml

import numpy as np

from kpred.exports.bodies import Body, bodies_of
from kpred.exports.furniture import Export
from kpred.exports.link_meshes import LinkMeshes, link_meshes
from kpred.exports.writer import Writer, bytes_writer
from kpred.exports.xml_text import numbers, roll_pitch_yaw, xml_bytes, xml_comment, xml_name

VERSION = "1.8"


def sdf_writers(export: Export, path: Path) -> dict[Path, Writer]:
    """Return the file and its meshes `STEM_*`: metres, z up, front +x.

    One object is a model in the place of the scan; several are the models of a world with a floor.
    """
    root = Xml.Element("sdf", version=VERSION)
    bodies = bodies_of(export)
    several = len(bodies) > 1
    parent = root
    if several:
        parent = Xml.SubElement(root, "world", name=xml_name(path.stem))
        parent.append(_floor(min(body.floor() for body in bodies)))
    writers: dict[Path, Writer] = {}
    for number, (furniture, body) in enumerate(zip(export.objects, bodies, strict=True)):
        meshes = link_meshes(export, furniture, body, f"{path.stem}_{number}" if several else path.stem)
        parent.append(xml_comment(furniture.credit.lines()))
        parent.append(_model(body, meshes))
        writers |= {path.with_name(file): bytes_writer(content) for file, content in meshes.files.items()}
    return {path: bytes_writer(xml_bytes(root))} | writers


def _model(body: Body, meshes: LinkMeshes) -> Xml.Element:
    model = Xml.Element("model", name=xml_name(body.name))
    _add_pose(model, body.pose[:3, 3], body.pose[:3, :3])
    link = Xml.SubElement(model, "link", name="link")
    inertial = Xml.SubElement(link, "inertial")
    _add_pose(inertial, body.center, np.eye(3))
    Xml.SubElement(inertial, "mass").text = f"{body.mass:.9g}"
    inertia = Xml.SubElement(inertial, "inertia")
    for row in range(3):
        for column in range(row, 3):
            Xml.SubElement(inertia, f"i{'xyz'[row]}{'xyz'[column]}").text = f"{body.inertia[row, column]:.9g}"
    visual = Xml.SubElement(link, "visual", name="visual")
    _add_mesh(visual, meshes.visual)
    for number, (collider, mesh) in enumerate(zip(body.colliders, meshes.colliders, strict=True)):
        element = Xml.SubElement(link, "collision", name=f"part_{number}")
        if mesh is not None:
            _add_mesh(element, mesh)
            continue
        _add_pose(element, collider.center, collider.rotation)
        box = Xml.SubElement(Xml.SubElement(element, "geometry"), "box")
        Xml.SubElement(box, "size").text = numbers(collider.size)
    return model


def _floor(height: float) -> Xml.Element:
    model = Xml.Element("model", name="floor")
    Xml.SubElement(model, "static").text = "true"
    _add_pose(model, np.array([0.0, 0.0, height]), np.eye(3))
    link = Xml.SubElement(model, "link", name="link")
    for kind in ("collision", "visual"):
        plane = Xml.SubElement(Xml.SubElement(Xml.SubElement(link, kind, name=kind), "geometry"), "plane")
        Xml.SubElement(plane, "normal").text = "0 0 1"
        Xml.SubElement(plane, "size").text = "50 50"
    return model


def _add_pose(parent: Xml.Element, place: np.ndarray, rotation: np.ndarray) -> None:
    Xml.SubElement(parent, "pose").text = numbers([*place, *roll_pitch_yaw(rotation)])


def _add_mesh(parent: Xml.Element, file: str) -> None:
    mesh = Xml.SubElement(Xml.SubElement(parent, "geometry"), "mesh")
    Xml.SubElement(mesh, "uri").text = file
