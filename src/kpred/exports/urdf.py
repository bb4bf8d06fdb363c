"""URDF of ROS: a link for each object, meshes beside the file."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as Xml

from kpred.exports.bodies import Body, bodies_of
from kpred.exports.furniture import Export
from kpred.exports.link_meshes import LinkMeshes, link_meshes
from kpred.exports.writer import Writer, bytes_writer
from kpred.exports.xml_text import numbers, roll_pitch_yaw, xml_bytes, xml_comment, xml_name


def urdf_writers(export: Export, path: Path) -> dict[Path, Writer]:
    """Return the file and its meshes `STEM_*`: metres, z up, front +x.

    One object is the root link, its origin on the floor; several hang at floating joints below the link `world`.
    """
    root = Xml.Element("robot", name=xml_name(path.stem))
    # MuJoCo drops folders and surfaces of URDF unless this is there; other readers ignore it.
    mujoco = Xml.SubElement(root, "mujoco")
    Xml.SubElement(mujoco, "compiler", strippath="false", fusestatic="false")
    several = len(export.objects) > 1
    if several:
        Xml.SubElement(root, "link", name="world")
    writers: dict[Path, Writer] = {}
    for number, (furniture, body) in enumerate(zip(export.objects, bodies_of(export), strict=True)):
        name = xml_name(body.name)
        stem = f"{path.stem}_{number}" if several else path.stem
        meshes = link_meshes(export, furniture, body, stem)
        root.append(xml_comment(furniture.credit.lines()))
        root.append(_link(body, name, meshes))
        writers |= {path.with_name(file): bytes_writer(content) for file, content in meshes.files.items()}
        if several:
            joint = Xml.SubElement(root, "joint", name=f"{name}_joint", type="floating")
            angles = roll_pitch_yaw(body.pose[:3, :3])
            Xml.SubElement(joint, "origin", xyz=numbers(body.pose[:3, 3]), rpy=numbers(angles))
            Xml.SubElement(joint, "parent", link="world")
            Xml.SubElement(joint, "child", link=name)
    return {path: bytes_writer(xml_bytes(root))} | writers


def _link(body: Body, name: str, meshes: LinkMeshes) -> Xml.Element:
    link = Xml.Element("link", name=name)
    inertial = Xml.SubElement(link, "inertial")
    Xml.SubElement(inertial, "origin", xyz=numbers(body.center), rpy="0 0 0")
    Xml.SubElement(inertial, "mass", value=f"{body.mass:.9g}")
    tensor = {
        f"i{'xyz'[row]}{'xyz'[column]}": f"{body.inertia[row, column]:.9g}"
        for row in range(3)
        for column in range(row, 3)
    }
    Xml.SubElement(inertial, "inertia", tensor)
    geometry = Xml.SubElement(Xml.SubElement(link, "visual"), "geometry")
    Xml.SubElement(geometry, "mesh", filename=meshes.visual)
    for collider, mesh in zip(body.colliders, meshes.colliders, strict=True):
        element = Xml.SubElement(link, "collision")
        if mesh is not None:
            Xml.SubElement(Xml.SubElement(element, "geometry"), "mesh", filename=mesh)
            continue
        angles = roll_pitch_yaw(collider.rotation)
        Xml.SubElement(element, "origin", xyz=numbers(collider.center), rpy=numbers(angles))
        Xml.SubElement(Xml.SubElement(element, "geometry"), "box", size=numbers(collider.size))
    return link
