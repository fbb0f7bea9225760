"""Layers over shots: what a renderer would resolve, and what USD's validators say."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("pxr")

import scenes  # noqa: E402
from pxr import Sdf, Usd, UsdGeom, UsdShade  # noqa: E402
from vrtm.bake.layer import LayerError, LayerPlan, check_layer, write_corner_uvs, write_layer  # noqa: E402
from vrtm.bake.scene import Scene, SceneOptions  # noqa: E402

FRAMES = (1, 2, 4)
OPEN: list[Usd.Stage] = []  # a stage that nothing holds takes its prims along


@pytest.fixture(autouse=True)
def let_go():
    yield
    OPEN.clear()


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
    return folder / "over.usda", write_layer(folder / "over.usda", scene, plan)


def corner_uvs(shape, frame: float) -> np.ndarray:
    """What a bake might find: each corner's own UV, and what a frame adds to it."""
    return shape.uvs[shape.uv_indices] + np.arange(2 * len(shape.indices)).reshape(-1, 2) * 0.001 * frame


def composed(folder: Path, file: str = "shot.usda") -> Usd.Stage:
    """The shot with the layer sublayered over it, as a user would do it."""
    OPEN.clear()
    root = Sdf.Layer.CreateNew(str(folder / "final.usda"))
    below = Sdf.Layer.FindOrOpen(str(folder / file))
    for name in ("timeCodesPerSecond", "framesPerSecond"):
        root.pseudoRoot.SetInfo(name, below.pseudoRoot.GetInfo(name))
    root.subLayerPaths = ["./over.usda", f"./{file}"]
    root.Save()
    OPEN.append(Usd.Stage.Open(root))
    return OPEN[-1]


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
    """What validators say that they do not say of the shot, or of the layer by itself."""
    return check_layer(folder / "over.usda", folder / file, options) + check_layer(folder / "over.usda")


def test_a_preview_surface_reads_the_primvar(tmp_path: Path) -> None:
    shot(tmp_path).Save()
    with Scene(tmp_path / "shot.usda") as scene:
        _, warnings = bake(tmp_path, scene, ("one", "two"))
        shape = scene.shape("two")
    assert warnings == [] and checked(tmp_path) == []
    stage = composed(tmp_path)
    for name in ("one", "two"):
        assert varname(texture(bound(stage, f"/world/{name}"))) == "st_redirected"
        primvar = UsdGeom.PrimvarsAPI(stage.GetPrimAtPath(f"/world/{name}")).GetPrimvar("st_redirected")
        assert primvar.GetInterpolation() == "faceVarying" and primvar.GetTypeName() == "texCoord2f[]"
        # Between frames they are interpolated, also where one was not baked; outside they are held.
        for time, frame in ((0, 1), (1, 1), (1.5, 1.5), (2, 2), (3, 3), (3.5, 3.5), (4, 4), (9, 4)):
            assert np.array(primvar.ComputeFlattened(time)) == pytest.approx(corner_uvs(shape, frame)), time
        assert primvar.GetAttr().GetTimeSamples() == [1, 2, 4]


def test_a_mesh_that_shares_the_material_is_left_alone(tmp_path: Path) -> None:
    shot(tmp_path).Save()
    bake(tmp_path, Scene(tmp_path / "shot.usda"))
    stage = composed(tmp_path)
    assert bound(stage, "/world/three").GetPath() == "/world/looks/skin"
    assert varname(texture(bound(stage, "/world/three"))) == "st"
    assert not stage.GetPrimAtPath("/world/three").HasAttribute("primvars:st_redirected")
    made = bound(stage, "/world/one")
    assert made.GetPath() != "/world/looks/skin" and made.GetBaseMaterialPath() == "/world/looks/skin"
    # Whoever changes the shot's material later changes the derived one, too.
    shader = UsdShade.Shader(stage.GetPrimAtPath("/world/looks/skin/surface"))
    stage.SetEditTarget(Sdf.Layer.Find(str(tmp_path / "shot.usda")))
    shader.CreateInput("roughness", scenes.TYPES.Float).Set(0.125)
    assert made.ComputeSurfaceSource()[0].GetInput("roughness").Get() == 0.125


def test_the_layer_holds_overs_alone_and_the_shot_is_not_touched(tmp_path: Path) -> None:
    shot(tmp_path).Save()
    before = (tmp_path / "shot.usda").read_bytes()
    path, _ = bake(tmp_path, Scene(tmp_path / "shot.usda"))
    layer = Sdf.Layer.FindOrOpen(str(path))
    assert list(layer.subLayerPaths) == [] and layer.defaultPrim == "world"
    assert layer.GetPrimAtPath("/world/one").specifier == Sdf.SpecifierOver
    assert (tmp_path / "shot.usda").read_bytes() == before
    assert sorted(p.name for p in tmp_path.iterdir() if ".part" in p.name) == []
    path, _ = bake(tmp_path, Scene(tmp_path / "shot.usda"), sublayer="./shot.usda")
    alone = Usd.Stage.Open(str(path))
    assert varname(texture(bound(alone, "/world/one"))) == "st_redirected"


def test_a_preview_surface_takes_warped_textures(tmp_path: Path) -> None:
    shot(tmp_path).Save()
    (tmp_path / "colour.1001.png").touch()
    asked = set()

    def warped(shape: str, frame: int, name: str) -> str:
        asked.add((shape, name))
        (tmp_path / f"warped.{shape}.{frame}.1001.png").touch()
        return f"./warped.{shape}.{frame}.<UDIM>.png"

    _, warnings = bake(tmp_path, Scene(tmp_path / "shot.usda"), corners=False, warped_path=warped)
    assert warnings == [] and checked(tmp_path) == []
    assert asked == {("one", str(tmp_path / "colour.<UDIM>.png"))}
    stage = composed(tmp_path)
    file = texture(bound(stage, "/world/one")).GetInput("file")
    for time, frame in ((0, 1), (1, 1), (1.5, 1), (2, 2), (3.9, 2), (4, 4), (9, 4)):
        assert file.Get(time).path == f"./warped.one.{frame}.<UDIM>.png", time
    assert varname(texture(bound(stage, "/world/one"))) == "st"
    assert texture(bound(stage, "/world/two")).GetInput("file").Get(2).path == "colour.<UDIM>.png"


def test_what_cannot_be_redirected_is_said_and_left(tmp_path: Path) -> None:
    stage = shot(tmp_path)
    scenes.bind(stage.GetPrimAtPath("/world/two"), scenes.preview_material(stage, "/world/looks/other", uv="second"))
    UsdShade.MaterialBindingAPI(stage.GetPrimAtPath("/world/three")).UnbindAllBindings()
    stage.Save()
    scene = Scene(tmp_path / "shot.usda")
    _, warnings = bake(tmp_path, scene, ("one",), corners=False, warped_path=lambda *_: None)
    assert "has neither a warped copy nor redirected corner UVs" in warnings[0]
    assert warnings[1] == "/world/one: no texture of /world/looks/skin could be redirected"
    final = composed(tmp_path)
    assert bound(final, "/world/one").GetPath() == "/world/looks/skin"
    assert not final.GetPrimAtPath("/world/looks/skin_one_redirected")
    _, warnings = bake(tmp_path, scene, ("two", "three"))
    assert (
        "/world/two: the texture /world/looks/other_two_redirected/colour is not looked up by the UVs 'st'"
        in warnings[0]
    )
    assert warnings[-1] == "/world/three: no material is bound to it"


@pytest.mark.parametrize("graph", [True, False])
def test_materialx_looks_the_map_up_before_a_transform(tmp_path: Path, graph: bool) -> None:
    stage = shot(tmp_path)
    scenes.bind(stage.GetPrimAtPath("/world/one"), scenes.materialx_material(stage, "/world/looks/mx", True, graph))
    stage.Save()
    _, warnings = bake(tmp_path, Scene(tmp_path / "shot.usda"), corners=False, tiles={"one": (1001, 1002)})
    assert warnings == [] and checked(tmp_path) == []
    image = source(bound(composed(tmp_path), "/world/one").ComputeSurfaceSource("mtlx")[0].GetInput("emission_color"))
    assert image.GetIdAttr().Get() == "ND_image_color3" and image.GetInput("file").Get().path == "colour.<UDIM>.exr"
    scale = source(image.GetInput("texcoord"))
    assert scale.GetIdAttr().Get() == "ND_multiply_vector2FA" and scale.GetInput("in2").Get() == 2
    lookup = source(scale.GetInput("in1"))
    assert (
        lookup.GetIdAttr().Get() == "ND_image_vector2" and lookup.GetPrim().GetParent() == scale.GetPrim().GetParent()
    )
    values = {name: lookup.GetInput(name).Get() for name in ("uaddressmode", "vaddressmode", "filtertype")}
    assert values == {"uaddressmode": "clamp", "vaddressmode": "clamp", "filtertype": "linear"}
    file = lookup.GetInput("file")
    assert file.GetAttr().GetColorSpace() == "raw"
    for time, frame in ((0, 1), (1, 1), (1.9, 1), (2, 2), (3, 2), (4, 4), (5, 4)):
        assert file.Get(time).path == f"./redirect.one.{frame:04}.<UDIM>.exr", time
    reader = source(lookup.GetInput("texcoord"))
    assert reader.GetIdAttr().Get() == "ND_geompropvalue_vector2" and reader.GetInput("geomprop").Get() == "st"


def test_materialx_with_the_uvs_by_default(tmp_path: Path) -> None:
    stage = shot(tmp_path)
    scenes.bind(stage.GetPrimAtPath("/world/one"), scenes.materialx_material(stage, "/world/looks/mx", False))
    stage.Save()
    scene = Scene(tmp_path / "shot.usda")

    def coordinate() -> UsdShade.Shader:
        surface = bound(composed(tmp_path), "/world/one").ComputeSurfaceSource("mtlx")[0]
        return source(source(surface.GetInput("emission_color")).GetInput("texcoord"))

    _, warnings = bake(tmp_path, scene, form="tile")
    assert warnings == [] and checked(tmp_path) == []
    assert coordinate().GetInput("file").Get(2).path == "./redirect.one.0002.1001.exr" and not coordinate().GetInput(
        "texcoord"
    )
    bake(tmp_path, scene, form="delta")
    assert checked(tmp_path) == []
    total = coordinate()
    assert total.GetIdAttr().Get() == "ND_add_vector2"
    assert source(total.GetInput("in1")).GetIdAttr().Get() == "ND_texcoord_vector2"
    assert source(total.GetInput("in2")).GetInput("file").Get(1).path == "./redirect.one.0001.1001.exr"
    assert source(source(total.GetInput("in2")).GetInput("texcoord")).GetIdAttr().Get() == "ND_texcoord_vector2"
    bake(tmp_path, scene, mode="primvar")
    assert checked(tmp_path) == []
    assert coordinate().GetIdAttr().Get() == "ND_geompropvalue_vector2"
    assert coordinate().GetInput("geomprop").Get() == "st_redirected"


def test_materialx_of_another_uv_set_stays(tmp_path: Path) -> None:
    stage = shot(tmp_path)
    scenes.bind(stage.GetPrimAtPath("/world/one"), scenes.materialx_material(stage, "/world/looks/mx"))
    UsdShade.Shader(stage.GetPrimAtPath("/world/looks/mx/graph/uv")).GetInput("geomprop").Set("second")
    stage.Save()
    _, warnings = bake(tmp_path, Scene(tmp_path / "shot.usda"))
    assert "mx_one_redirected/graph/colour is not looked up by the UVs 'st'" in warnings[0]


def test_a_coordinate_that_comes_through_the_interface_of_a_graph(tmp_path: Path) -> None:
    stage = shot(tmp_path)
    material = scenes.materialx_material(stage, "/world/looks/mx", False)
    reader = scenes.shader(stage, "/world/looks/mx/uv", "ND_texcoord_vector2")
    graph = UsdShade.NodeGraph(stage.GetPrimAtPath("/world/looks/mx/graph"))
    port = graph.CreateInput("uv", scenes.TYPES.Float2)
    port.ConnectToSource(reader.CreateOutput("out", scenes.TYPES.Float2))
    image = UsdShade.Shader(stage.GetPrimAtPath("/world/looks/mx/graph/colour"))
    image.CreateInput("texcoord", scenes.TYPES.Float2).ConnectToSource(port)
    scenes.bind(stage.GetPrimAtPath("/world/one"), material)
    stage.Save()
    _, warnings = bake(tmp_path, Scene(tmp_path / "shot.usda"))
    assert warnings == [] and checked(tmp_path) == [], "nodes are plugged to nodes of the same graph alone"
    made = bound(composed(tmp_path), "/world/one")
    lookup = source(UsdShade.Shader(made.GetPrim().GetChild("graph").GetChild("colour")).GetInput("texcoord"))
    assert lookup.GetPrim().GetParent() == made.GetPrim() and lookup.GetIdAttr().Get() == "ND_image_vector2"
    assert source(lookup.GetInput("texcoord")).GetPrim().GetName() == "uv"


def test_purposes_and_subsets_keep_their_materials(tmp_path: Path) -> None:
    stage = shot(tmp_path)
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/world/one"))
    full = scenes.preview_material(stage, "/world/looks/full", "full.png")
    nail = scenes.preview_material(stage, "/world/looks/nail", "nail.png")
    group = stage.GetPrimAtPath("/world")
    UsdShade.MaterialBindingAPI.Apply(group).Bind(full, materialPurpose="full")
    api = UsdShade.MaterialBindingAPI(mesh)
    subset = api.CreateMaterialBindSubset("nail", [1])
    api.SetMaterialBindSubsetsFamilyType("nonOverlapping")
    UsdShade.MaterialBindingAPI.Apply(subset.GetPrim()).Bind(nail)
    stage.Save()
    _, warnings = bake(tmp_path, Scene(tmp_path / "shot.usda"))
    assert warnings == [] and checked(tmp_path) == []
    final = composed(tmp_path)
    for path, purpose, base in (
        ("/world/one", "", "skin"),
        ("/world/one", "preview", "skin"),
        ("/world/one", "full", "full"),
        ("/world/one/nail", "", "nail"),
        ("/world/one/nail", "full", "full"),
    ):
        made = bound(final, path, purpose)
        assert made.GetBaseMaterialPath() == f"/world/looks/{base}", (path, purpose)
        assert varname(texture(made)) == "st_redirected"
    assert bound(final, "/world/two", "full").GetPath() == "/world/looks/full"


def test_a_binding_that_is_stronger_is_said(tmp_path: Path) -> None:
    stage = shot(tmp_path)
    other = scenes.preview_material(stage, "/world/looks/other")
    UsdShade.MaterialBindingAPI.Apply(stage.GetPrimAtPath("/world")).Bind(other, "strongerThanDescendants")
    stage.Save()
    _, warnings = bake(tmp_path, Scene(tmp_path / "shot.usda"))
    assert warnings == [
        "/world/one: a stronger binding keeps /world/looks/other in the place of /world/looks/other_one_redirected"
    ]


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
    _, warnings = bake(tmp_path, scene)
    assert warnings == [
        f"/set/{n}: is no instance any more, since what is inside is redirected" for n in ("left", "right")
    ]
    assert checked(tmp_path) == []
    final = composed(tmp_path)
    for name in ("left", "right"):
        path = f"/set/{name}/one"
        assert bound(final, path).GetPath() == f"/set/{name}/looks/skin_one_redirected"
        assert varname(texture(bound(final, path))) == "st_redirected"
        primvar = UsdGeom.PrimvarsAPI(final.GetPrimAtPath(path)).GetPrimvar("st_redirected")
        assert np.array(primvar.Get(2)) == pytest.approx(corner_uvs(scene.shapes[0], 2))
    # With plain prims in the shot, the scene finds two shapes: bake and layer are of the shot without the layer.
    write_layer(tmp_path / "over.usda", scene, LayerPlan(FRAMES, ("one",), corner_path=lambda *_: "./x.usdc"))


def test_instanceable_materials(tmp_path: Path) -> None:
    stage = shot(tmp_path)
    stage.GetPrimAtPath("/world/looks/skin").SetInstanceable(True)
    stage.Save()
    _, warnings = bake(tmp_path, Scene(tmp_path / "shot.usda"))
    assert warnings == [] and varname(texture(bound(composed(tmp_path), "/world/one"))) == "st_redirected"


def test_variants_are_those_that_were_baked(tmp_path: Path) -> None:
    stage = shot(tmp_path)
    look = stage.GetPrimAtPath("/world").GetVariantSets().AddVariantSet("size")
    for name in ("small", "large"):
        look.AddVariant(name)
        look.SetVariantSelection(name)
        if name == "large":
            with look.GetVariantEditContext():
                skin = UsdShade.Material(stage.GetPrimAtPath("/world/looks/skin"))
                scenes.bind(scenes.mesh(stage, "/world/big"), skin)
    look.SetVariantSelection("small")
    stage.Save()
    options = SceneOptions(variants=(("/world", "size", "large"),))
    _, warnings = bake(tmp_path, Scene(tmp_path / "shot.usda", options), ("big",))
    assert warnings == [] and checked(tmp_path, options=options) == []
    assert varname(texture(bound(composed(tmp_path), "/world/big"))) == "st_redirected"


def test_time_codes_are_the_shots(tmp_path: Path) -> None:
    stage = shot(tmp_path, fps=24)
    stage.SetTimeCodesPerSecond(48)
    stage.Save()
    scene = Scene(tmp_path / "shot.usda")
    bake(tmp_path, scene)
    primvar = UsdGeom.PrimvarsAPI(composed(tmp_path).GetPrimAtPath("/world/one")).GetPrimvar("st_redirected")
    assert primvar.GetAttr().GetTimeSamples() == [1, 2, 4]
    assert np.array(primvar.Get(4)) == pytest.approx(corner_uvs(scene.shape("one"), 4))


def test_baking_again_over_a_shot_that_has_the_layer(tmp_path: Path) -> None:
    shot(tmp_path).Save()
    path, _ = bake(tmp_path, Scene(tmp_path / "shot.usda"))
    composed(tmp_path)
    scene = Scene(tmp_path / "final.usda")
    assert scene.shape("one").uv_name == "st"
    bake(tmp_path, scene)
    layer = Sdf.Layer.FindOrOpen(str(path))
    assert [spec.name for spec in layer.GetPrimAtPath("/world/looks").nameChildren] == ["skin_one_redirected"]


def test_corner_uvs_of_a_refined_mesh_are_those_of_its_cage(tmp_path: Path) -> None:
    stage = shot(tmp_path)
    UsdGeom.Mesh(stage.GetPrimAtPath("/world/one")).CreateSubdivisionSchemeAttr("catmullClark")
    stage.Save()
    scene = Scene(tmp_path / "shot.usda", SceneOptions(subdivide=2))
    bake(tmp_path, scene)
    shape, cage = scene.shape("one"), Scene(tmp_path / "shot.usda").shape("one")
    found = UsdGeom.PrimvarsAPI(composed(tmp_path).GetPrimAtPath("/world/one")).GetPrimvar("st_redirected").Get(1)
    assert len(shape.indices) == 128 and np.array(found) == pytest.approx(corner_uvs(shape, 1)[shape.cage_corners])
    assert np.array(found) == pytest.approx(cage.uvs[cage.uv_indices], abs=0.3), "the same corners"
    with pytest.raises(ValueError, match=r"uvs: the shape \(3, 2\) is not \(128, 2\)"):
        write_corner_uvs(tmp_path / "x.usdc", shape, 1, np.zeros((3, 2)))


def test_bytes_do_not_depend_on_the_run(tmp_path: Path) -> None:
    script = f"""
import sys; sys.path.insert(0, {str(Path(__file__).parent)!r})
from pathlib import Path; import test_layer
test_layer.shot(Path(sys.argv[1])).Save()
test_layer.bake(Path(sys.argv[1]), test_layer.Scene(sys.argv[1] + "/shot.usda"), ("one", "two"))
"""
    for number in range(2):
        (tmp_path / str(number)).mkdir()
        environment = os.environ | {
            "PYTHONHASHSEED": str(number),
            "PYTHONPATH": os.pathsep.join(p for p in sys.path if p),
        }
        subprocess.run([sys.executable, "-c", script, tmp_path / str(number)], check=True, env=environment)
    files = [path.relative_to(tmp_path / "0") for path in sorted((tmp_path / "0").rglob("*")) if path.is_file()]
    assert {"over.usda", "over.manifest.usda", "st/one.1.usdc"} <= {str(file) for file in files}
    for file in files:
        assert (tmp_path / "0" / file).read_bytes() == (tmp_path / "1" / file).read_bytes(), file


def test_validators_notice_a_missing_file_and_a_wrong_type(tmp_path: Path) -> None:
    shot(tmp_path).Save()
    scene = Scene(tmp_path / "shot.usda")
    path, _ = bake(tmp_path, scene)
    (tmp_path / "st/one.2.usdc").unlink()
    assert any("one.2.usdc" in found for found in checked(tmp_path))
    bake(tmp_path, scene)
    layer = Sdf.Layer.FindOrOpen(str(path))
    spec = layer.GetPrimAtPath("/world/looks/skin_one_redirected")
    Sdf.RelationshipSpec(spec, "outputs:surface")
    over = Sdf.CreatePrimInLayer(layer, "/world/looks/skin_one_redirected/colour")
    Sdf.AttributeSpec(over, "inputs:st", scenes.TYPES.Float3)
    layer.Save()
    assert any("skin_one_redirected" in found for found in checked(tmp_path))


def test_normal_maps_are_said_to_need_more(tmp_path: Path) -> None:
    stage = shot(tmp_path)
    surface = UsdShade.Shader(stage.GetPrimAtPath("/world/looks/skin/surface"))
    colour = UsdShade.Shader(stage.GetPrimAtPath("/world/looks/skin/colour"))
    surface.CreateInput("normal", scenes.TYPES.Normal3f).ConnectToSource(colour.GetOutput("rgb"))
    stage.Save()
    _, warnings = bake(tmp_path, Scene(tmp_path / "shot.usda"))
    assert warnings == [
        "/world/one: /world/looks/skin_one_redirected/surface takes a normal map, which the layer looks up redirected, "
        "but does not turn"
    ]


def test_a_scene_of_another_kind_has_no_layer(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n")
    with pytest.raises(LayerError, match=r"a\.obj: only a USD scene can have a layer over it"):
        write_layer(tmp_path / "over.usda", Scene(tmp_path / "a.obj"), LayerPlan((1,), ("a",)))


def test_wrong_plans(tmp_path: Path) -> None:
    shot(tmp_path).Save()
    scene = Scene(tmp_path / "shot.usda")
    for plan, message in (
        ({"mode": "uv"}, "mode 'uv'"),
        ({"form": "uv"}, "form 'uv'"),
        ({"mode": "both", "corners": False}, "needs the corner UVs"),
        ({"form": "tile", "tiles": {"one": (1001, 1002)}}, "cannot serve one, whose tiles are"),
    ):
        with pytest.raises(LayerError, match=message):
            bake(tmp_path, scene, **plan)
