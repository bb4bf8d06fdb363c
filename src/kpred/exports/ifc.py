"""IFC4 for buildings: an IfcFurniture with type, placement, colours and facts. Needs ifcopenshell."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from kpred._version import __version__
from kpred.exports.furniture import Export, Furniture
from kpred.exports.libraries import library
from kpred.exports.surfaces import Surface, surfaces_of
from kpred.exports.writer import Writer

TYPES = {"chair": "CHAIR", "table": "TABLE", "desk": "DESK", "bed": "BED", "sofa": "SOFA", "shelf": "SHELF"}
"""IFC's own types of furniture, by category; others are user defined."""

FACTS = "Kpred_Fit"
"""Name of the set of properties that holds model id, confidence, author and licence."""


def ifc_writers(export: Export, path: Path) -> dict[Path, Writer]:
    """Return the one file: metres, z up; furniture stands in a storey of a building.

    Raises:
        OutputError: ifcopenshell is not installed.
    """
    library("ifcopenshell.api", "bim", path)
    model = _model(export, path.stem)
    return {path: lambda file: model.write(str(file))}


def _model(export: Export, name: str) -> Any:
    from ifcopenshell.api import aggregate, context, project, root, spatial, unit

    model = project.create_file(version="IFC4")
    whole = root.create_entity(model, ifc_class="IfcProject", name=name)
    unit.assign_unit(model, length={"is_metric": True, "raw": "METERS"})
    outer = context.add_context(model, context_type="Model")
    body = context.add_context(
        model, context_type="Model", context_identifier="Body", target_view="MODEL_VIEW", parent=outer
    )
    parent = whole
    for kind, label in (("IfcSite", "Site"), ("IfcBuilding", "Building"), ("IfcBuildingStorey", "Storey")):
        child = root.create_entity(model, ifc_class=kind, name=label)
        aggregate.assign_object(model, products=[child], relating_object=parent)
        parent = child
    made = [_furniture(model, export, one, body) for one in export.objects]
    spatial.assign_container(model, products=made, relating_structure=parent)
    return model


def _furniture(model: Any, export: Export, furniture: Furniture, body: Any) -> Any:
    from ifcopenshell.api import geometry, pset, root, type

    credit = furniture.credit
    element = root.create_entity(model, ifc_class="IfcFurniture", name=furniture.name)
    kind = root.create_entity(
        model,
        ifc_class="IfcFurnitureType",
        name=credit.details.get("title") or credit.model_id,
        predefined_type=TYPES.get(credit.category, "USERDEFINED"),
    )
    kind.ElementType, kind.AssemblyPlace = credit.category, "FACTORY"
    surfaces = surfaces_of(furniture, export.scan_to_body(furniture))
    shape = model.create_entity(
        "IfcShapeRepresentation",
        ContextOfItems=body,
        RepresentationIdentifier="Body",
        RepresentationType="Tessellation",
        Items=[_face_set(model, one) for one in surfaces],
    )
    geometry.assign_representation(model, product=kind, representation=shape)
    type.assign_type(model, related_objects=[element], relating_type=kind)
    element.ObjectType, element.Tag = credit.category, credit.model_id  # `assign_type` clears the first.
    geometry.edit_object_placement(model, product=element, matrix=export.body_frame(furniture), is_si=True)
    facts = {key: _value(value) for key, value in credit.asset()["extras"].items()}
    found = pset.add_pset(model, product=element, name=FACTS)
    pset.edit_pset(model, pset=found, properties={**facts, "generator": f"kpred {__version__}"})
    return element


def _face_set(model: Any, surface: Surface) -> Any:
    points = model.create_entity("IfcCartesianPointList3D", CoordList=np.round(surface.vertices, 7).tolist())
    faces = model.create_entity(
        "IfcTriangulatedFaceSet", Coordinates=points, Closed=False, CoordIndex=(surface.faces + 1).tolist()
    )
    red, green, blue, alpha = surface.material.color
    color = model.create_entity("IfcColourRgb", None, red, green, blue)
    shading = model.create_entity("IfcSurfaceStyleShading", color, 1.0 - alpha)
    style = model.create_entity("IfcSurfaceStyle", surface.material.name, "BOTH", [shading])
    model.create_entity("IfcStyledItem", faces, [style], None)
    return faces


def _value(value: Any) -> str | float:
    return value if isinstance(value, str | float) else str(value)
