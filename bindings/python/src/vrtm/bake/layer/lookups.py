"""Which textures a shot's materials look up by redirected UVs."""

from __future__ import annotations

from pxr import Usd, UsdGeom, UsdShade

from vrtm.bake.layer.networks import MTLX_IMAGES
from vrtm.bake.layer.write import bindings_of
from vrtm.bake.scene import Scene, Shape
from vrtm.bake.scene.usd_stage import assets, marked


def looked_up(scene: Scene, shape: Shape, mode: str) -> list[str]:
    """The files of all textures of a shape's materials that copies do not replace, whatever UVs they take: those of
    MaterialX, which are looked up through the maps, and with redirected corner UVs (`mode`) all. Layers of earlier
    bakes do not count."""
    stage = scene.source.stage
    names = MTLX_IMAGES if mode == "texture" else (*MTLX_IMAGES, "UsdUVTexture")
    ours = marked(stage)
    found: dict[str, None] = {}
    with scene.listening():
        for path in shape.instances:
            mesh = stage.GetPrimAtPath(path)
            subsets = UsdShade.MaterialBindingAPI(mesh).GetMaterialBindSubsets()
            prims = [mesh, *(s.GetPrim() for s in subsets if s.GetElementTypeAttr().Get() == UsdGeom.Tokens.face)]
            materials = {material.GetPath(): material for prim in prims for _, material in bindings_of(prim)}
            for material in materials.values():
                for prim in Usd.PrimRange(material.GetPrim(), Usd.TraverseInstanceProxies()):
                    shader = UsdShade.Shader(prim)
                    plug = shader.GetInput("file") if shader else None
                    if plug and (shader.GetIdAttr().Get() or "").startswith(names):
                        for attribute in UsdShade.Utils.GetValueProducingAttributes(plug)[:1]:
                            found |= dict.fromkeys(_files(attribute, ours))
    return list(found)


def _files(attribute: Usd.Attribute, ours: set[str]) -> list[str]:
    files = list(assets(attribute, ours))
    specs = attribute.GetPropertyStack()
    named = attribute.Get() if not files and specs and specs[0].layer.identifier not in ours else None
    # One that is not there may be where it is rendered.
    return files or ([named.path] if named else [])
