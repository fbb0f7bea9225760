"""A shot, a bake's layer over it, what a renderer would resolve of both, and USD's own validation of it."""

from pathlib import Path
from typing import Any

import numpy as np
from pxr import Sdf, Sdr, Usd, UsdGeom, UsdShade, UsdUtils, UsdValidation

import scenes
from vrtm.bake.layer.clips import corner_uv_layer, export, values_hash
from vrtm.bake.layer.plan import LayerPlan
from vrtm.bake.layer.write import compose, write_layer
from vrtm.bake.scene import Scene, SceneOptions, Shape

FRAMES = (1, 2, 4)
OPEN: list[Usd.Stage] = []  # a stage that nothing holds takes its prims along


def shot(folder: Path, fps: float = 24, file: str = "shot.usda") -> Usd.Stage:
    """Two meshes that share a material, and a third one with another material."""
    stage = scenes.stage(folder / file, 1, 4, fps)
    world = UsdGeom.Xform.Define(stage, "/world").GetPrim()
    stage.SetDefaultPrim(world)
    Usd.ModelAPI(world).SetKind("component")
    UsdGeom.Scope.Define(stage, "/world/looks")
    skin = scenes.preview_material(stage, "/world/looks/skin")
    for name in ("one", "two", "three"):
        scenes.bind(scenes.mesh(stage, f"/world/{name}"), skin)
    return stage


def bake(folder: Path, scene: Scene, shapes=("one",), files: bool = True, **plan) -> tuple[Path, list[str]]:
    """Writes a layer, and stand-ins for what it names."""
    if plan.pop("corners", True):
        plan["corner_path"] = lambda shape, frame: f"./st/{shape}.{frame}.usdc"
        for name in shapes:
            for frame in FRAMES:
                shape = scene.shape(name)
                write_corner_uvs(folder / f"st/{name}.{frame}.usdc", shape, frame, corner_uvs(shape, frame))
    if plan.pop("maps", True):
        plan["map_path"] = lambda shape, frame, udim: f"./redirect.{shape}.{frame:04}.{udim}.exr"
    for name in shapes if files else ():
        for frame in FRAMES:
            for udim in plan.get("tiles", {}).get(name, (1001,)):
                (folder / f"redirect.{name}.{frame:04}.{udim}.exr").touch()
    plan = LayerPlan(frames=FRAMES, shapes=shapes, **plan)
    return folder / "over.usda", write_layer(folder / "over.usda", scene, plan).warnings


def over(stage: Usd.Stage, shapes=("one",), options: SceneOptions | None = None, **plan) -> tuple[Usd.Stage, list[str]]:
    """Saves a shot and writes a layer over it: the stage of both, and the layer's warnings."""
    stage.Save()
    path = Path(stage.GetRootLayer().realPath)
    with Scene(path, options or SceneOptions()) as scene:
        _, warnings = bake(path.parent, scene, shapes, **plan)
    return composed(path, path.parent / "over.usda"), warnings


def write_corner_uvs(path: Path, shape: Shape, frame: float, uvs: np.ndarray) -> None:
    export(corner_uv_layer(shape, frame, uvs), path, values_hash)


def corner_uvs(shape, frame: float) -> np.ndarray:
    """UVs as a bake might find them: each corner's own, and a shift that grows with the frame."""
    return shape.uvs[shape.uv_indices] + np.arange(2 * len(shape.indices)).reshape(-1, 2) * 0.001 * frame


def composed(baked: Path, layer: Path) -> Usd.Stage:
    """The shot with the layer sublayered over it, as a user would do it."""
    root = Sdf.Layer.CreateAnonymous(".usda")
    below = Sdf.Layer.FindOrOpen(str(baked))
    for name in ("timeCodesPerSecond", "framesPerSecond"):
        root.pseudoRoot.SetInfo(name, below.pseudoRoot.GetInfo(name))
    root.subLayerPaths = [str(layer), str(baked)]
    # A stage with an earlier layer may still be open.
    Sdf.Layer.FindOrOpen(str(layer)).Reload(force=True)
    OPEN[:] = [Usd.Stage.Open(root)]
    return OPEN[0]


def bound(stage: Usd.Stage, path: str, purpose: str = "") -> UsdShade.Material:
    return UsdShade.MaterialBindingAPI(stage.GetPrimAtPath(path)).ComputeBoundMaterial(purpose)[0]


def source(plug: UsdShade.Input | UsdShade.Output) -> UsdShade.Shader:
    """The shader whose output reaches a plug, through node graphs."""
    (found,) = UsdShade.Utils.GetValueProducingAttributes(plug)
    return UsdShade.Shader(found.GetPrim())


def texture(material: UsdShade.Material) -> UsdShade.Shader:
    return source(material.ComputeSurfaceSource()[0].GetInput("diffuseColor"))


def varname(shader: UsdShade.Shader) -> str:
    return UsdShade.Utils.GetValueProducingAttributes(source(shader.GetInput("st")).GetInput("varname"))[0].Get()


def checked(folder: Path, file: str = "shot.usda", options: SceneOptions | None = None) -> list[str]:
    """Complaints of validators about the layer over the shot, less those about the shot; and about the layer alone."""
    return check_layer(folder / "over.usda", folder / file, options) + check_layer(folder / "over.usda")


def check_layer(path: Path, shot: Path | None = None, options: SceneOptions | None = None) -> list[str]:
    """Complaints of USD's validators, which usdchecker runs, about a layer: over its shot, less those about the shot
    alone, or by itself. Unknown nodes of MaterialX are left out in a build of USD that knows none of them."""
    layer = Sdf.Layer.FindOrOpen(str(path))
    if shot is None:
        return sorted(_complaints(Usd.Stage.Open(layer)))
    options = options or SceneOptions()
    alone = compose(Sdf.Layer.CreateAnonymous(".usda"), str(shot), options, muted=str(path))
    return sorted(_complaints(compose(layer, str(shot), options)) - _complaints(alone))


def _complaints(stage: Usd.Stage) -> set[str]:
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    # Kept while the validators run: what they say besides is about paths that are checked below.
    delegate = UsdUtils.CoalescingDiagnosticDelegate()
    knows_materialx = any(name.startswith("ND_") for name in Sdr.Registry().GetShaderNodeIdentifiers())
    found = set()
    for error in UsdValidation.ValidationContext(validators).Validate(stage):
        text = error.GetMessage()
        if error.GetName() == "MissingShaderIdInRegistry" and "'ND_" in text and not knows_materialx:
            continue
        places = {_place(site) for site in error.GetSites()} - {""}
        found.add(f"{error.GetName()}: {text}{' at ' if places else ''}{' '.join(sorted(places))}")
    delegate.TakeUncoalescedDiagnostics()
    return found


def _place(site: Any) -> str:
    """A prim's or property's path; layers in memory have no name worth telling."""
    if site.IsPrim():
        return str(site.GetPrim().GetPath())
    if site.IsProperty():
        return str(site.GetProperty().GetPath())
    layer = site.GetLayer()
    return layer.identifier if layer and not layer.anonymous else ""
