"""USD read back by usd-core: metres, y up, materials with textures, facts."""

from pathlib import Path

import numpy as np
import pytest

from kpred.exports.formats import save_export
from kpred.exports.furniture import Export

pytest.importorskip("pxr")


@pytest.mark.parametrize("extension", [".usd", ".usda", ".usdc", ".usdz"])
def test_a_chair_stands_upright_in_metres(chair: Export, tmp_path: Path, extension: str) -> None:
    from pxr import Usd, UsdGeom

    file, *_ = save_export(chair, tmp_path / f"chair{extension}")
    stage = Usd.Stage.Open(str(file))
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    assert UsdGeom.GetStageUpAxis(stage) == "Y"
    box = UsdGeom.BBoxCache(Usd.TimeCode.Default(), ["default"]).ComputeWorldBound(stage.GetDefaultPrim())
    low, high = (
        np.array(corner) for corner in (box.ComputeAlignedRange().GetMin(), box.ComputeAlignedRange().GetMax())
    )
    wanted = chair.objects[0].vertices[:, [0, 2, 1]] * [1, 1, -1] / 1000
    np.testing.assert_allclose([low[1], high[1]], [wanted[:, 1].min(), wanted[:, 1].max()], atol=1e-5)
    points = np.concatenate(
        [
            np.array(UsdGeom.Mesh(prim).GetPointsAttr().Get())
            @ np.array(UsdGeom.XformCache().GetLocalToWorldTransform(prim))[:3, :3]
            + np.array(UsdGeom.XformCache().GetLocalToWorldTransform(prim))[3, :3]
            for prim in stage.Traverse()
            if prim.IsA(UsdGeom.Mesh)
        ]
    )
    np.testing.assert_allclose(points.min(axis=0), wanted.min(axis=0), atol=1e-5)
    np.testing.assert_allclose(points.max(axis=0), wanted.max(axis=0), atol=1e-5)


@pytest.mark.parametrize("extension", [".usda", ".usdz"])
def test_materials_textures_and_facts_are_there(room: Export, tmp_path: Path, extension: str) -> None:
    from pxr import Usd, UsdShade

    file, *beside = save_export(room, tmp_path / f"room{extension}")
    stage = Usd.Stage.Open(str(file))
    textures = [
        UsdShade.Shader(prim).GetInput("file").Get()
        for prim in stage.Traverse()
        if prim.IsA(UsdShade.Shader) and UsdShade.Shader(prim).GetIdAttr().Get() == "UsdUVTexture"
    ]
    assert len(textures) == 8  # The legs of two chairs.
    assert all(texture.resolvedPath for texture in textures)
    assert bool(beside) == (extension == ".usda")
    facts = stage.GetPrimAtPath("/scan/chair_1").GetCustomData()["kpred"]
    assert facts["model_id"] == "shop/chair 7" and facts["licence"] == "CC0-1.0" and facts["confidence"] == 0.75
