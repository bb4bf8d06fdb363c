"""USD: metres, y up; the prim `/scan` is the scan's own frame and unit. Needs usd-core."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from kpred.exports.furniture import Export, Furniture
from kpred.exports.libraries import library
from kpred.exports.surfaces import Material, Surface, surfaces_of
from kpred.exports.writer import Writer, bytes_writer

ROOT = "/scan"


def usd_writers(export: Export, path: Path) -> dict[Path, Writer]:
    """Return the file, and textures `STEM_*.png` beside it; a .usdz holds its textures.

    Raises:
        OutputError: usd-core is not installed.
    """
    for module in ("pxr.Usd", "pxr.UsdGeom", "pxr.UsdShade", "pxr.UsdUtils"):
        library(module, "usd", path)
    textures: dict[str, bytes] = {}
    stage = _stage(export, path.stem, textures)
    if path.suffix.lower() == ".usdz":
        return {path: lambda file: _write_package(stage, textures, file)}
    writers: dict[Path, Writer] = {path: lambda file: stage.Export(str(file))}
    return writers | {path.with_name(name): bytes_writer(content) for name, content in textures.items()}


def _stage(export: Export, stem: str, textures: dict[str, bytes]) -> Any:
    from pxr import Gf, Tf, Usd, UsdGeom

    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    root = UsdGeom.Xform.Define(stage, ROOT)
    # USD multiplies row vectors.
    root.AddTransformOp().Set(Gf.Matrix4d(export.scan_to_y_up.T.tolist()))
    stage.SetDefaultPrim(root.GetPrim())
    for furniture in export.objects:
        place = f"{ROOT}/{Tf.MakeValidIdentifier(furniture.name)}"
        node = UsdGeom.Xform.Define(stage, place)
        node.GetPrim().SetCustomData({"kpred": _facts(furniture)})
        node.GetPrim().SetDisplayName(furniture.name)
        middle = np.round(furniture.vertices.mean(axis=0))  # USD holds points as float32.
        node.AddTranslateOp().Set(Gf.Vec3d(*middle.tolist()))
        near = np.eye(4)
        near[:3, 3] = -middle
        for number, surface in enumerate(surfaces_of(furniture, near)):
            name = f"{stem}_{Tf.MakeValidIdentifier(furniture.name)}_{number}.png"
            if surface.material.texture is not None and surface.uv is not None:
                textures[name] = surface.material.texture
            _add_mesh(stage, f"{place}/{Tf.MakeValidIdentifier(f's{surface.name}')}", surface, name)
    return stage


def _add_mesh(stage: Any, place: str, surface: Surface, texture: str) -> None:
    from pxr import Sdf, UsdGeom, UsdShade, Vt

    mesh = UsdGeom.Mesh.Define(stage, place)
    points = np.ascontiguousarray(surface.vertices, dtype=np.float32)
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(surface.faces), 3, dtype=np.int32)))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(surface.faces.ravel().astype(np.int32)))
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreateDoubleSidedAttr(True)
    mesh.CreateExtentAttr(Vt.Vec3fArray.FromNumpy(np.stack([points.min(axis=0), points.max(axis=0)])))
    has_texture = surface.material.texture is not None and surface.uv is not None
    if surface.uv is not None:
        primvars = UsdGeom.PrimvarsAPI(mesh.GetPrim())
        st = primvars.CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.vertex)
        st.Set(Vt.Vec2fArray.FromNumpy(np.ascontiguousarray(surface.uv, dtype=np.float32)))
    material = _material(stage, f"{place}_material", surface.material, f"./{texture}" if has_texture else None)
    UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(material)


def _material(stage: Any, place: str, found: Material, texture: str | None) -> Any:
    from pxr import Gf, Sdf, UsdShade

    material = UsdShade.Material.Define(stage, place)
    shader = UsdShade.Shader.Define(stage, f"{place}/shader")
    shader.CreateIdAttr("UsdPreviewSurface")
    kinds = Sdf.ValueTypeNames
    color = shader.CreateInput("diffuseColor", kinds.Color3f)
    color.Set(Gf.Vec3f(*found.color[:3]))
    shader.CreateInput("opacity", kinds.Float).Set(found.color[3])
    shader.CreateInput("metallic", kinds.Float).Set(found.metallic)
    shader.CreateInput("roughness", kinds.Float).Set(found.roughness)
    material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
    if texture is None:
        return material
    reader = UsdShade.Shader.Define(stage, f"{place}/st")
    reader.CreateIdAttr("UsdPrimvarReader_float2")
    reader.CreateInput("varname", kinds.String).Set("st")
    sampler = UsdShade.Shader.Define(stage, f"{place}/texture")
    sampler.CreateIdAttr("UsdUVTexture")
    sampler.CreateInput("file", kinds.Asset).Set(Sdf.AssetPath(texture))
    sampler.CreateInput("scale", kinds.Float4).Set(Gf.Vec4f(*found.color))
    for side in ("wrapS", "wrapT"):
        sampler.CreateInput(side, kinds.Token).Set("repeat")
    sampler.CreateInput("st", kinds.Float2).ConnectToSource(reader.CreateOutput("result", kinds.Float2))
    color.ConnectToSource(sampler.CreateOutput("rgb", kinds.Float3))
    return material


def _facts(furniture: Furniture) -> dict[str, str | float]:
    entries: Mapping[str, Any] = furniture.credit.asset()["extras"]
    return {key: value if isinstance(value, str | float) else str(value) for key, value in entries.items()}


def _write_package(stage: Any, textures: Mapping[str, bytes], file: Path) -> None:
    from pxr import UsdUtils

    with TemporaryDirectory(prefix="kpred-") as folder:
        for name, content in textures.items():
            Path(folder, name).write_bytes(content)
        layer = Path(folder, "scan.usdc")
        stage.Export(str(layer))
        if not UsdUtils.CreateNewUsdzPackage(str(layer), str(file)):
            raise OSError(f"{file}: the package could not be written")
