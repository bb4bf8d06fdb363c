"""IFC4 read back by ifcopenshell: furniture with type, name, placement and facts, in metres."""

from pathlib import Path

import numpy as np
import pytest

from kpred.exports.formats import save_export
from kpred.exports.furniture import Export

ifcopenshell = pytest.importorskip("ifcopenshell")


def test_furniture_has_type_name_placement_and_facts(chair: Export, tmp_path: Path) -> None:
    import ifcopenshell.util.element
    import ifcopenshell.util.placement
    import ifcopenshell.util.unit

    (file,) = save_export(chair, tmp_path / "chair.ifc")
    model = ifcopenshell.open(str(file))
    assert model.schema == "IFC4"
    assert ifcopenshell.util.unit.calculate_unit_scale(model) == 1.0
    (furniture,) = model.by_type("IfcFurniture")
    assert (furniture.Name, furniture.ObjectType) == ("chair 0", "chair")
    kind = ifcopenshell.util.element.get_type(furniture)
    assert (kind.Name, kind.PredefinedType) == ("A chair", "CHAIR")
    matrix = ifcopenshell.util.placement.get_local_placement(furniture.ObjectPlacement)
    np.testing.assert_allclose(matrix, chair.body_frame(chair.objects[0]), atol=1e-6)
    facts = ifcopenshell.util.element.get_pset(furniture, "Kpred_Fit")
    assert (facts["model_id"], facts["author"], facts["licence"]) == ("shop/chair 7", "Ann", "CC0-1.0")
    assert ifcopenshell.util.element.get_container(furniture).is_a("IfcBuildingStorey")


def test_the_geometry_lies_where_the_scan_was(room: Export, tmp_path: Path) -> None:
    import ifcopenshell.geom

    (file,) = save_export(room, tmp_path / "room.ifc")
    model = ifcopenshell.open(str(file))
    settings = ifcopenshell.geom.settings()
    settings.set("use-world-coords", True)
    found = []
    for furniture in model.by_type("IfcFurniture"):
        shape = ifcopenshell.geom.create_shape(settings, furniture)
        found.append(np.reshape(shape.geometry.verts, (-1, 3)))
    assert len(found) == 2
    for vertices, one in zip(sorted(found, key=lambda points: points[:, 0].mean()), room.objects, strict=True):
        np.testing.assert_allclose(vertices.min(axis=0), one.vertices.min(axis=0) / 1000, atol=1e-5)
        np.testing.assert_allclose(vertices.max(axis=0), one.vertices.max(axis=0) / 1000, atol=1e-5)


def test_it_is_valid(chair: Export, tmp_path: Path) -> None:
    import ifcopenshell.validate

    (file,) = save_export(chair, tmp_path / "chair.ifc")
    log = ifcopenshell.validate.json_logger()
    ifcopenshell.validate.validate(ifcopenshell.open(str(file)), log)
    assert log.statements == []
