"""Writes a small shot to try `vrtm bake` on: python scene.py [FOLDER]

An arm with studs that bends in 24 frames, as USD with a material, with its texture and the map of what is rigid:
FOLDER/arm.usda, colour.1001.png, rigid.1001.png. Needs pip install './bindings/python[bake]'.
"""

import argparse
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
from pxr import Sdf, Usd, UsdGeom, UsdShade, Vt

FRAMES = 24


def arm(angle: float, rings: int = 97, sides: int = 97) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A half tube along x, bent by `angle` (radians) about its middle: positions (rings * sides, 3), quadrilaterals
    (faces, 4) and UVs (rings * sides, 2). The seen side is the outside of the bend."""
    u, v = np.meshgrid(np.linspace(0, 1, sides), np.linspace(0, 1, rings), indexing="ij")
    along, around = 6 * (u - 0.5), np.pi * (v - 0.5)
    y, z = np.sin(around), np.cos(around)
    # The bone is straight, then an arc over which the bend is spread, then straight again.
    half = 0.6
    turned = np.clip(along, -half, half) / half * angle / 2
    radius = 2 * half / angle if angle else np.inf
    straight = along - np.clip(along, -half, half)
    x0 = radius * np.sin(turned) if angle else np.clip(along, -half, half)
    z0 = radius * (np.cos(turned) - 1) if angle else 0 * along
    x = x0 + straight * np.cos(turned) + z * np.sin(turned)
    z = z0 - straight * np.sin(turned) + z * np.cos(turned)
    number = np.arange(u.size).reshape(u.shape)
    quads = np.stack([number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]], -1)
    return np.stack([x, y, z], -1).reshape(-1, 3), quads.reshape(-1, 4), np.stack([u, v], -1).reshape(-1, 2)


def painted(size: int = 1024) -> tuple[np.ndarray, np.ndarray]:
    """A skin with studs: its colour (size, size, 3) and its rigidity (size, size), rows from v = 1 down."""
    v, u = (np.mgrid[:size, :size] + 0.5) / size
    # The tube is 6 long and pi around: studs that are round on it.
    x, y = 6 * u, np.pi * v
    step = 0.75
    row = np.round(y / (step * 0.866))
    shift = (row % 2) * step / 2
    radius = np.hypot((x - shift + step / 2) % step - step / 2, y - row * step * 0.866)
    stud = np.clip((0.24 - radius) / 0.01, 0, 1)
    grain = 0.04 * np.sin(40 * x + 3 * np.sin(17 * y)) * np.sin(37 * y + 2 * np.sin(23 * x))
    skin = np.array([0.62, 0.42, 0.30]) + grain[..., None]
    metal = np.array([0.86, 0.84, 0.78]) * (0.75 + 0.25 * np.cos(radius / 0.24 * 1.4))[..., None]
    return skin + stud[..., None] * (metal - skin), np.clip((0.26 - radius) / 0.02, 0, 1).astype(np.float32)


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

    surface = node("surface", "UsdPreviewSurface")
    image = node("image", "UsdUVTexture")
    uv = node("uv", "UsdPrimvarReader_float2")
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
    mesh.CreateExtentAttr(UsdGeom.PointBased.ComputeExtent(Vt.Vec3fArray.FromNumpy(rest.astype("f4"))))
    UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(write_material(stage, "./colour.<UDIM>.png"))
    stage.Save()
    print(f"{folder / 'arm.usda'}: {len(faces)} faces, {FRAMES} frames")


if __name__ == "__main__":
    main()
