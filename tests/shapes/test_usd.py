"""Meshes and clouds in USD, as RoomPlan, Polycam and Blender lay them out; what is damaged or leads out is refused."""

import warnings
from pathlib import Path

import numpy as np
import pytest
import trimesh

from kpred.errors import MeshError
from kpred.scenes.scene import read_scene
from kpred.shapes.formats.usd import read_usd
from kpred.shapes.mesh_io import read_geometry, read_mesh
from kpred.shapes.scan import read_scan

pytest.importorskip("pxr")

from pxr import Gf, Sdf, Usd, UsdGeom, UsdUtils  # noqa: E402

BOX = trimesh.creation.box((1.0, 2.0, 0.5))
BOX.apply_translation((0.3, 0.1, 0.2))


def new_stage(path: Path, up: str = "Y") -> Usd.Stage:
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, up)
    return stage


def add_mesh(stage: Usd.Stage, path: str, mesh: trimesh.Trimesh = BOX, **more: object) -> UsdGeom.Mesh:
    added = UsdGeom.Mesh.Define(stage, path)
    added.GetPointsAttr().Set([tuple(row) for row in mesh.vertices.tolist()])
    added.GetFaceVertexCountsAttr().Set([3] * len(mesh.faces))
    added.GetFaceVertexIndicesAttr().Set(mesh.faces.ravel().tolist())
    return added


def volume(path: Path) -> float:
    found = read_geometry(path)
    return float(trimesh.Trimesh(found.vertices, found.faces, process=False).volume)


def test_transforms_units_and_every_container(tmp_path):
    stage = new_stage(tmp_path / "a.usda", "Z")
    root = UsdGeom.Xform.Define(stage, "/room")
    root.AddTranslateOp().Set((10, 0, 0))
    root.AddRotateZOp().Set(90)
    UsdGeom.Xformable(add_mesh(stage, "/room/box")).AddScaleOp().Set((2, 1, 1))
    stage.GetRootLayer().Save()
    stage.Export(str(tmp_path / "a.usdc"))
    stage.Export(str(tmp_path / "a.usd"))
    UsdUtils.CreateNewUsdzPackage(Sdf.AssetPath(str(tmp_path / "a.usdc")), str(tmp_path / "a.usdz"))
    x, y, z = (BOX.vertices * [2, 1, 1]).T
    for name in ("a.usda", "a.usdc", "a.usd", "a.usdz"):
        found = read_geometry(tmp_path / name)
        np.testing.assert_allclose(found.vertices, np.stack([10 - y, x, z], axis=1), atol=1e-6, err_msg=name)
        assert volume(tmp_path / name) == pytest.approx(2.0), name
        assert read_scene(tmp_path / name).up == "z"
    assert read_mesh(tmp_path / "a.usdz").faces.shape == (12, 3)
    assert read_scan(tmp_path / "a.usdz").shape == (32768, 3)


def test_mirrors_left_hands_polygons_and_holes(tmp_path):
    stage = new_stage(tmp_path / "a.usda")
    UsdGeom.Xformable(add_mesh(stage, "/mirrored")).AddScaleOp().Set((-1, 1, 1))
    left = add_mesh(stage, "/left")
    left.GetOrientationAttr().Set("leftHanded")
    left.GetFaceVertexIndicesAttr().Set(BOX.faces[:, ::-1].ravel().tolist())
    sheet = UsdGeom.Mesh.Define(stage, "/sheet")
    sheet.GetPointsAttr().Set([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0.5, 1.5, 0)])
    sheet.GetFaceVertexCountsAttr().Set([5, 3])
    sheet.GetFaceVertexIndicesAttr().Set([0, 1, 2, 4, 3, 0, 1, 2])
    sheet.GetHoleIndicesAttr().Set([1])
    stage.GetRootLayer().Save()
    found = read_geometry(tmp_path / "a.usda")
    for part, expected in ((0, 1.0), (1, 1.0)):
        faces = found.faces[found.parts == part]
        assert trimesh.Trimesh(found.vertices, faces, process=False).volume == pytest.approx(expected)
    faces = found.faces[found.parts == 2]
    assert trimesh.Trimesh(found.vertices, faces, process=False).area == pytest.approx(1.25)


def test_solids(tmp_path):
    stage = new_stage(tmp_path / "a.usda")
    UsdGeom.Cube.Define(stage, "/cube").GetSizeAttr().Set(3)
    UsdGeom.Sphere.Define(stage, "/sphere").GetRadiusAttr().Set(2)
    for name, kind in (("cylinder", UsdGeom.Cylinder), ("cone", UsdGeom.Cone), ("capsule", UsdGeom.Capsule)):
        solid = kind.Define(stage, f"/{name}")
        solid.GetHeightAttr().Set(4)
        solid.GetRadiusAttr().Set(1)
        solid.GetAxisAttr().Set("X")
    stage.GetRootLayer().Save()
    found = read_geometry(tmp_path / "a.usda")
    expected = [27, 32 / 3 * np.pi, 4 * np.pi, 4 / 3 * np.pi, 4 * np.pi + 4 / 3 * np.pi]
    for part, right in enumerate(expected):
        faces = found.faces[found.parts == part]
        assert trimesh.Trimesh(found.vertices, faces, process=False).volume == pytest.approx(right, rel=0.03), part
        if part > 1:
            assert np.abs(found.vertices[np.unique(faces), 0]).max() == pytest.approx(2 if part < 4 else 3)


def test_instances_points_and_what_is_not_seen(tmp_path):
    stage = new_stage(tmp_path / "a.usda")
    hidden = UsdGeom.Xform.Define(stage, "/hidden")
    hidden.MakeInvisible()
    add_mesh(stage, "/hidden/box")
    add_mesh(stage, "/guide").GetPurposeAttr().Set("guide")
    instancer = UsdGeom.PointInstancer.Define(stage, "/many")
    UsdGeom.Xformable(add_mesh(stage, "/many/prototypes/box")).AddScaleOp().Set((2, 2, 2))
    instancer.GetPrototypesRel().SetTargets(["/many/prototypes/box"])
    instancer.GetProtoIndicesAttr().Set([0, 0])
    instancer.GetPositionsAttr().Set([(0, 0, 0), (50, 0, 0)])
    stage.GetRootLayer().Save()
    assert volume(tmp_path / "a.usda") == pytest.approx(16.0)
    found = read_geometry(tmp_path / "a.usda")
    assert set(found.parts.tolist()) == {0, 1}
    np.testing.assert_allclose(found.vertices[8:] - found.vertices[:8], np.tile([50.0, 0, 0], (8, 1)), atol=1e-5)
    cloud = new_stage(tmp_path / "b.usda")
    points = np.random.default_rng(0).normal(size=(200, 3)).astype(np.float32)
    UsdGeom.Points.Define(cloud, "/cloud").GetPointsAttr().Set([tuple(row) for row in points.tolist()])
    cloud.GetRootLayer().Save()
    np.testing.assert_array_equal(read_scan(tmp_path / "b.usda"), points.astype(float))


def test_a_room_of_many_files_in_one_package(tmp_path):
    (tmp_path / "assets").mkdir()
    chair = new_stage(tmp_path / "assets/chair.usda")
    UsdGeom.Xform.Define(chair, "/chair")
    add_mesh(chair, "/chair/geometry")
    chair.SetDefaultPrim(chair.GetPrimAtPath("/chair"))
    chair.GetRootLayer().Save()
    room = new_stage(tmp_path / "Room.usda")
    for number in range(3):
        prim = UsdGeom.Xform.Define(room, f"/Room/Object_grp/Chair{number}").GetPrim()
        prim.GetReferences().AddReference("./assets/chair.usda")
        prim.SetInstanceable(number > 0)
        UsdGeom.Xformable(prim).AddTransformOp().Set(Gf.Matrix4d().SetTranslate(Gf.Vec3d(10.0 * number, 0, 0)))
    room.GetRootLayer().Save()
    UsdUtils.CreateNewUsdzPackage(Sdf.AssetPath(str(tmp_path / "Room.usda")), str(tmp_path / "Room.usdz"))
    for name in ("Room.usda", "Room.usdz"):
        assert volume(tmp_path / name) == pytest.approx(3.0), name
        assert read_geometry(tmp_path / name).vertices[:, 0].max() == pytest.approx(20.8)


@pytest.mark.parametrize("place", ["..", "link"])
def test_layers_outside_of_the_folder_are_not_read(tmp_path, place):
    secret = new_stage(tmp_path / "secret.usda")
    add_mesh(secret, "/secret")
    secret.SetDefaultPrim(secret.GetPrimAtPath("/secret"))
    secret.GetRootLayer().Save()
    (tmp_path / "open").mkdir()
    (tmp_path / "open/link.usda").symlink_to(tmp_path / "secret.usda")
    stage = new_stage(tmp_path / "open/a.usda")
    name = "../secret.usda" if place == ".." else "./link.usda"
    stage.OverridePrim("/found").GetReferences().AddReference(name)
    stage.GetRootLayer().Save()
    with pytest.raises(MeshError, match="outside of its folder"):
        read_geometry(tmp_path / "open/a.usda")


@pytest.mark.parametrize("name", ["a.usda", "a.usdc", "a.usdz"])
def test_damaged_files_are_one_sentence(tmp_path, name):
    stage = new_stage(tmp_path / "whole.usda")
    add_mesh(stage, "/box")
    stage.GetRootLayer().Save()
    stage.Export(str(tmp_path / "whole.usdc"))
    UsdUtils.CreateNewUsdzPackage(Sdf.AssetPath(str(tmp_path / "whole.usdc")), str(tmp_path / "whole.usdz"))
    data = (tmp_path / name.replace("a", "whole", 1)).read_bytes()
    for broken in (data[: len(data) // 2], data[:40], b"PK\x03\x04" + bytes(60)):
        (tmp_path / name).write_bytes(broken)
        with pytest.raises(MeshError, match=f"{name}: ") as caught:
            read_geometry(tmp_path / name)
        assert "\n" not in str(caught.value)


def test_references_that_multiply_are_given_up(tmp_path):
    text = "#usda 1.0\n"
    for level in range(12):
        inner = "".join(f'  def "p{n}" (references = </l{level + 1}>) {{}}\n' for n in range(10)) if level < 11 else ""
        text += f'def Xform "l{level}" {{\n{inner}}}\n'
    (tmp_path / "bomb.usda").write_text(text)
    with pytest.raises(MeshError, match="took more than|too much memory"):
        read_usd(tmp_path / "bomb.usda", seconds=2.0)


def test_without_usd_core_the_extra_is_named(tmp_path, monkeypatch):
    (tmp_path / "a.usdz").write_bytes(b"PK\x03\x04" + bytes(60))
    monkeypatch.setattr("kpred.shapes.formats.usd.find_spec", lambda name: None)
    with pytest.raises(MeshError, match=r"pip install 'kpred\[usd\]'"), warnings.catch_warnings():
        read_geometry(tmp_path / "a.usdz")
