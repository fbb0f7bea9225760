"""Writes a small shot to try `vrtm bake` on: python scene.py [FOLDER]

An arm with studs that bends in 24 frames, as USD with a material, with its texture and the map of what is rigid:
FOLDER/arm.usda, colour.1001.png, rigid.1001.png. Needs pip install './bindings/python[bake]'.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
from figure import arm, painted
from pxr import Sdf, Usd, UsdGeom, UsdShade, Vt

FRAMES = 24


def write_image(path: Path, pixels: np.ndarray) -> None:
    """Writes an image (height, width, channels) of 0..1 in 8 bits."""
    if not oiio.ImageBuf(np.ascontiguousarray(pixels, np.float32)).write(str(path), "uint8"):
        raise SystemExit(f"{path}: {oiio.geterror()}")


def write_material(stage: Usd.Stage, texture: str) -> UsdShade.Material:
    """A UsdPreviewSurface with one texture at the UVs `st`."""
    material = UsdShade.Material.Define(stage, "/arm/skin")

    def node(name: str, kind: str) -> UsdShade.Shader:
        shader = UsdShade.Shader.Define(stage, material.GetPath().AppendChild(name))
        shader.CreateIdAttr(kind)
        return shader

    surface, image, uv = (
        node("surface", "UsdPreviewSurface"),
        node("image", "UsdUVTexture"),
        node("uv", "UsdPrimvarReader_float2"),
    )
    kinds = Sdf.ValueTypeNames
    uv.CreateInput("varname", kinds.String).Set("st")
    image.CreateInput("file", kinds.Asset).Set(texture)
    image.CreateInput("st", kinds.Float2).ConnectToSource(uv.CreateOutput("result", kinds.Float2))
    rgb = image.CreateOutput("rgb", kinds.Float3)
    surface.CreateInput("diffuseColor", kinds.Color3f).ConnectToSource(rgb)
    surface.CreateInput("roughness", kinds.Float).Set(0.5)
    material.CreateSurfaceOutput().ConnectToSource(surface.CreateOutput("surface", kinds.Token))
    return material


def main() -> None:
    parser = argparse.ArgumentParser(description="writes a small shot to try vrtm bake on")
    parser.add_argument("folder", nargs="?", type=Path, default=Path("shot"), help="where to write (shot)")
    folder = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)

    colour, rigidity = painted()
    write_image(folder / "colour.1001.png", colour)
    write_image(folder / "rigid.1001.png", rigidity[..., None])

    rest, faces, uvs = arm(0)
    stage = Usd.Stage.CreateNew(str(folder / "arm.usda"))
    stage.SetStartTimeCode(1)
    stage.SetEndTimeCode(FRAMES)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 0.1)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/arm").GetPrim())
    mesh = UsdGeom.Mesh.Define(stage, "/arm/mesh")
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(faces), 4, np.int32)))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(faces.reshape(-1).astype(np.int32)))
    st = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.vertex)
    st.Set(Vt.Vec2fArray.FromNumpy(uvs.astype(np.float32)))
    points = mesh.CreatePointsAttr()
    for frame in range(1, FRAMES + 1):
        # It begins and ends softly. The first frame is the arm at rest.
        share = (1 - np.cos(np.pi * (frame - 1) / (FRAMES - 1))) / 2
        points.Set(Vt.Vec3fArray.FromNumpy(arm(np.radians(110 * share))[0].astype(np.float32)), frame)
    UsdGeom.Boundable(mesh).CreateExtentAttr(
        UsdGeom.PointBased.ComputeExtent(Vt.Vec3fArray.FromNumpy(rest.astype("f4")))
    )
    UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(write_material(stage, "./colour.<UDIM>.png"))
    stage.Save()
    print(f"{folder / 'arm.usda'}: {len(faces)} faces, {FRAMES} frames")


if __name__ == "__main__":
    main()
