"""Layers over shots: what a renderer would resolve, and what USD's validators say."""

from pathlib import Path

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdGeom, UsdShade

import scenes
from shots import FRAMES, bound, checked, corner_uvs, over, shot, texture, varname
from vrtm.bake.layer.plan import LayerPlan
from vrtm.bake.layer.write import write_layer
from vrtm.bake.scene import Scene, SceneOptions


@pytest.fixture
def stage(tmp_path: Path) -> Usd.Stage:
    return shot(tmp_path)


def redirected(stage: Usd.Stage, path: str = "/world/one") -> UsdGeom.Primvar:
    return UsdGeom.PrimvarsAPI(stage.GetPrimAtPath(path)).GetPrimvar("st_redirected")


def test_a_preview_surface_reads_the_primvar(stage: Usd.Stage, tmp_path: Path) -> None:
    final, warnings = over(stage, ("one", "two"))
    shape = Scene(tmp_path / "shot.usda").shape("two")
    assert warnings == [] and checked(tmp_path) == []
    for name in ("one", "two"):
        assert varname(texture(bound(final, f"/world/{name}"))) == "st_redirected"
        primvar = redirected(final, f"/world/{name}")
        assert primvar.GetInterpolation() == "faceVarying" and primvar.GetTypeName() == "texCoord2f[]"
        # Between frames they are interpolated, also where one was not baked; outside they are held.
        for time, frame in ((0, 1), (1, 1), (1.5, 1.5), (2, 2), (3, 3), (3.5, 3.5), (4, 4), (9, 4)):
            assert np.array(primvar.ComputeFlattened(time)) == pytest.approx(corner_uvs(shape, frame)), time
        assert primvar.GetAttr().GetTimeSamples() == [1, 2, 4]


def test_a_mesh_that_shares_the_material_is_left_alone(stage: Usd.Stage, tmp_path: Path) -> None:
    final, _ = over(stage)
    assert bound(final, "/world/three").GetPath() == "/world/looks/skin"
    assert varname(texture(bound(final, "/world/three"))) == "st" and not redirected(final, "/world/three")
    made = bound(final, "/world/one")
    assert made.GetPath() != "/world/looks/skin" and made.GetBaseMaterialPath() == "/world/looks/skin"
    # Whoever changes the shot's material later changes the derived one, too.
    shader = UsdShade.Shader(final.GetPrimAtPath("/world/looks/skin/surface"))
    final.SetEditTarget(Sdf.Layer.Find(str(tmp_path / "shot.usda")))
    shader.CreateInput("roughness", scenes.TYPES.Float).Set(0.125)
    assert made.ComputeSurfaceSource()[0].GetInput("roughness").Get() == 0.125


def test_the_layer_holds_overs_alone_and_the_shot_is_not_touched(stage: Usd.Stage, tmp_path: Path) -> None:
    before = Path(scenes.saved(stage)).read_bytes()
    over(stage)
    layer = Sdf.Layer.FindOrOpen(str(tmp_path / "over.usda"))
    assert list(layer.subLayerPaths) == [] and layer.defaultPrim == "world"
    assert layer.GetPrimAtPath("/world/one").specifier == Sdf.SpecifierOver
    assert (tmp_path / "shot.usda").read_bytes() == before
    assert sorted(p.name for p in tmp_path.iterdir() if ".part" in p.name) == []


def test_instances_become_plain_prims(tmp_path: Path) -> None:
    asset = shot(tmp_path, file="asset.usda")
    for name in ("two", "three"):
        asset.RemovePrim(f"/world/{name}")
    asset.Save()
    stage = scenes.stage(tmp_path / "shot.usda", 1, 4)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/set").GetPrim())
    Usd.ModelAPI(stage.GetDefaultPrim()).SetKind("assembly")
    for name in ("left", "right"):
        prim = UsdGeom.Xform.Define(stage, f"/set/{name}").GetPrim()
        prim.GetReferences().AddReference("asset.usda")
        prim.SetInstanceable(True)
    stage.Save()
    scene = Scene(tmp_path / "shot.usda")
    assert len(scene.shapes) == 1
    final, warnings = over(stage)
    told = "is no instance any more, since what is inside is redirected"
    assert warnings == [f"/set/{name}: {told}" for name in ("left", "right")] and checked(tmp_path) == []
    for name in ("left", "right"):
        path = f"/set/{name}/one"
        assert bound(final, path).GetPath() == f"/set/{name}/looks/skin_one_redirected"
        assert varname(texture(bound(final, path))) == "st_redirected"
        assert np.array(redirected(final, path).Get(2)) == pytest.approx(corner_uvs(scene.shapes[0], 2))
    # With plain prims in the shot, the scene finds two shapes: bake and layer are of the shot without the layer.
    write_layer(tmp_path / "over.usda", scene, LayerPlan(FRAMES, ("one",), corner_path=lambda *_: "./x.usdc"))


def test_variants_are_those_that_were_baked(stage: Usd.Stage, tmp_path: Path) -> None:
    look = stage.GetPrimAtPath("/world").GetVariantSets().AddVariantSet("size")
    for name in ("small", "large"):
        look.AddVariant(name)
    look.SetVariantSelection("large")
    with look.GetVariantEditContext():
        scenes.bind(scenes.mesh(stage, "/world/big"), UsdShade.Material.Get(stage, "/world/looks/skin"))
    look.SetVariantSelection("small")
    options = SceneOptions(variants=(("/world", "size", "large"),))
    final, warnings = over(stage, ("big",), options)
    assert warnings == [] and checked(tmp_path, options=options) == []
    assert varname(texture(bound(final, "/world/big"))) == "st_redirected"
