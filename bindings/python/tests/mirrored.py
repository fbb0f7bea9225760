"""A model whose halves lie on the same UVs, and what a renderer would resolve of a bake's layer over it."""

from pathlib import Path

import numpy as np
from pxr import Sdf, Usd, UsdGeom, UsdShade

import scenes
from bake_scenes import image
from conftest import centres, grid

MESH = "/model/mirrored"
CELLS = 12
SIZE = 128


def mirrored(folder: Path, frames: int = 2, make=scenes.materialx_material, scheme: str = "none") -> Path:
    """A surface whose halves lie on the same UVs of tile 1001 and share the vertices of the middle, with a third part
    in tile 1002. The halves are stretched in different ways. A material is bound to the mesh; studs are rigid."""
    folder.mkdir(parents=True, exist_ok=True)
    stage = scenes.stage(folder / "shot.usda", 1, frames, fps=None, meters=1)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/model").GetPrim())
    square, faces = grid(CELLS)
    # The same way round, seen from the front.
    parts = [(square, faces, 0), (0 - square * [1, -1, 0], faces[:, ::-1], 0), (np.add(square, [2, 0, 0]), faces, 1)]
    rest, indices = np.unique(np.concatenate([at[of.ravel()] for at, of, _ in parts]), axis=0, return_inverse=True)
    uvs = np.concatenate([0.05 + 0.9 * square[of.ravel(), :2] + [tile, 0] for _, of, tile in parts])
    poses = {}
    for frame in range(1, frames + 1):
        moved, (x, y) = rest.copy(), rest[:, :2].T
        amount = frame / frames
        moved[:, 0] += amount * np.where(x > 0, 0.2 * np.sin(3 * x) * y, -0.1 * np.sin(6 * x))
        moved[:, 1] += amount * np.where(x > 0, 0.25 * y * y, 0.15 * np.sin(5 * y))
        poses[frame] = moved
    mesh = scenes.mesh(stage, MESH, rest, uvs, "faceVarying", faces=indices, poses=poses, pref=True)
    mesh.CreateSubdivisionSchemeAttr(scheme)
    mesh.CreateExtentAttr([(-2, -1, -1), (4, 3, 1)])
    scenes.bind(mesh, make(stage, "/model/skin"))
    stage.Save()
    u, v = centres(SIZE)
    # Away from the borders, where nothing moves.
    studs = (np.hypot((u * 5) % 1 - 0.5, (v * 5) % 1 - 0.5) < 0.25) & (np.maximum(abs(u - 0.5), abs(v - 0.5)) < 0.4)
    for udim in (1001, 1002):
        image(folder / f"rigid.{udim}.png", (255 * studs).astype(np.uint8)[..., None])
        image(folder / f"colour.{udim}.png", np.stack([255 * u, 255 * (1 - v), 255 * studs], -1).astype(np.uint8))
    return folder / "shot.usda"


def materials(stage: Usd.Stage) -> dict[str, tuple[np.ndarray, Sdf.Path]]:
    """The faces of the mesh and of each subset, less those of subsets, and the material that counts there."""
    mesh = stage.GetPrimAtPath(MESH)
    rest = np.ones(len(UsdGeom.Mesh(mesh).GetFaceVertexCountsAttr().Get()), bool)
    found = {}
    for subset in UsdShade.MaterialBindingAPI(mesh).GetMaterialBindSubsets():
        faces = np.array(subset.GetIndicesAttr().Get(2))
        assert rest[faces].all(), "faces in two subsets"
        rest[faces] = False
        material = UsdShade.MaterialBindingAPI(subset.GetPrim()).ComputeBoundMaterial()[0]
        found[subset.GetPrim().GetName()] = (faces, material)
    found[""] = (np.flatnonzero(rest), UsdShade.MaterialBindingAPI(mesh).ComputeBoundMaterial()[0])
    return found


def looked_up(material: UsdShade.Material) -> str:
    """The map, or copy of a texture, that a material names in frame 2."""
    nodes = {prim.GetName(): UsdShade.Shader(prim) for prim in Usd.PrimRange(material.GetPrim())}
    return nodes.get("vrtm_redirected", nodes.get("colour")).GetInput("file").Get(2).path


def check_family(stage: Usd.Stage, kind: str) -> None:
    imageable = UsdGeom.Imageable(stage.GetPrimAtPath(MESH))
    assert UsdGeom.Subset.GetFamilyType(imageable, "materialBind") == kind
    valid, reason = UsdGeom.Subset.ValidateFamily(imageable, UsdGeom.Tokens.face, "materialBind")
    assert valid, reason
