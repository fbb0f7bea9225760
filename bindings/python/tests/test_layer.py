"""Layers over shots: what a renderer would resolve, and what USD's validators say; which textures of materials are
looked up where, and what cannot be."""

from pathlib import Path

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdGeom, UsdShade

import scenes
from shots import FRAMES, bound, checked, corner_uvs, over, shot, source, texture, varname
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
        scenes.instance(stage, f"/set/{name}", "/world", "asset.usda")
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


def node(stage: Usd.Stage, path: str) -> UsdShade.Shader:
    """A node of a material below /world/looks."""
    return UsdShade.Shader(stage.GetPrimAtPath(f"/world/looks/{path}"))


def file_of(stage: Usd.Stage, path: str = "/world/one", time: float = 2) -> str:
    """The file that the texture of a mesh names."""
    return texture(bound(stage, path)).GetInput("file").Get(time).path


def test_a_preview_surface_takes_warped_textures(stage: Usd.Stage, tmp_path: Path) -> None:
    (tmp_path / "colour.1001.png").touch()
    asked = set()

    def warped(shape: str, frame: int, name: str) -> str:
        asked.add((shape, name))
        (tmp_path / f"warped.{shape}.{frame}.1001.png").touch()
        return f"./warped.{shape}.{frame}.<UDIM>.png"

    final, warnings = over(stage, corners=False, warped_path=warped)
    assert warnings == [] and checked(tmp_path) == []
    assert asked == {("one", str(tmp_path / "colour.<UDIM>.png"))}
    for time, frame in ((0, 1), (1, 1), (1.5, 1), (2, 2), (3.9, 2), (4, 4), (9, 4)):
        assert file_of(final, time=time) == f"./warped.one.{frame}.<UDIM>.png", time
    assert varname(texture(bound(final, "/world/one"))) == "st" and file_of(final, "/world/two") == "colour.<UDIM>.png"


def test_prototypes_below_an_over_stay_out_of_the_picture(stage: Usd.Stage) -> None:
    UsdGeom.PointInstancer.Define(stage, "/many").CreatePrototypesRel().SetTargets(["/world"])
    stage.GetPrimAtPath("/world").SetSpecifier(Sdf.SpecifierOver)
    final, _ = over(stage, corners=False, warped_path=lambda shape, frame, name: "./warped.<UDIM>.png")
    assert file_of(final) == "./warped.<UDIM>.png" and not final.GetPrimAtPath("/world/one").IsDefined()


def test_what_cannot_be_redirected_is_said_and_left(stage: Usd.Stage) -> None:
    scenes.bind(stage.GetPrimAtPath("/world/two"), scenes.preview_material(stage, "/world/looks/other", uv="second"))
    UsdShade.MaterialBindingAPI(stage.GetPrimAtPath("/world/three")).UnbindAllBindings()
    final, warnings = over(stage, corners=False, warped_path=lambda *_: None)
    assert len(warnings) == 1 and "/world/looks/skin/colour has neither a warped copy nor redirected" in warnings[0]
    assert bound(final, "/world/one").GetPath() == "/world/looks/skin"
    assert not final.GetPrimAtPath("/world/looks/skin_one_redirected")
    other = "/world/two: the texture /world/looks/other/colour is looked up by 'second', not by the UVs 'st'"
    _, warnings = over(stage, ("two", "three"))
    assert other in warnings[0] and warnings[-1] == "/world/three: no material is bound to it"
    # Nor is a warped copy wired in.
    final, warnings = over(stage, ("two",), corners=False, warped_path=lambda *_: "./warped.png")
    assert other in warnings[0] and len([warning for warning in warnings if "is looked up by 'second'" in warning]) == 1
    assert "neither a warped copy" not in "".join(warnings) and file_of(final, "/world/two") == "colour.<UDIM>.png"


def test_normal_maps_are_said_to_need_more_where_they_are_redirected(stage: Usd.Stage) -> None:
    for uv, name in (("st", "one"), ("second", "two")):
        material = scenes.preview_material(stage, f"/world/looks/{uv}", uv=uv)
        normal = node(stage, f"{uv}/surface").CreateInput("normal", scenes.TYPES.Normal3f)
        normal.ConnectToSource(node(stage, f"{uv}/colour").GetOutput("rgb"))
        scenes.bind(stage.GetPrimAtPath(f"/world/{name}"), material)
    _, warnings = over(stage, ("one", "two"))
    assert [warning for warning in warnings if "does not turn" in warning] == [
        "/world/one: /world/looks/st_one_redirected/surface takes a normal map, which the layer looks up redirected, "
        "but does not turn"
    ]
    # A warped copy is turned by who warps it.
    assert over(stage, corners=False, warped_path=lambda *_: "./warped.png")[1] == []


@pytest.mark.parametrize("graph", [True, False])
def test_materialx_looks_the_map_up_before_a_transform(stage: Usd.Stage, tmp_path: Path, graph: bool) -> None:
    scenes.bind(stage.GetPrimAtPath("/world/one"), scenes.materialx_material(stage, "/world/looks/mx", True, graph))
    final, warnings = over(stage, corners=False, tiles={"one": (1001, 1002)})
    assert warnings == [] and checked(tmp_path) == []
    image = source(bound(final, "/world/one").ComputeSurfaceSource("mtlx")[0].GetInput("emission_color"))
    assert image.GetIdAttr().Get() == "ND_image_color3" and image.GetInput("file").Get().path == "colour.<UDIM>.exr"
    scale = source(image.GetInput("texcoord"))
    assert scale.GetIdAttr().Get() == "ND_multiply_vector2FA" and scale.GetInput("in2").Get() == 2
    lookup = source(scale.GetInput("in1"))
    assert lookup.GetIdAttr().Get() == "ND_image_vector2"
    assert lookup.GetPrim().GetParent() == scale.GetPrim().GetParent()
    values = {name: lookup.GetInput(name).Get() for name in ("uaddressmode", "vaddressmode", "filtertype")}
    assert values == {"uaddressmode": "clamp", "vaddressmode": "clamp", "filtertype": "linear"}
    file = lookup.GetInput("file")
    assert file.GetAttr().GetColorSpace() == "raw"
    for time, frame in ((0, 1), (1, 1), (1.9, 1), (2, 2), (3, 2), (4, 4), (5, 4)):
        assert file.Get(time).path == f"./redirect.one.{frame:04}.<UDIM>.exr", time
    reader = source(lookup.GetInput("texcoord"))
    assert reader.GetIdAttr().Get() == "ND_geompropvalue_vector2" and reader.GetInput("geomprop").Get() == "st"


def test_materialx_with_the_uvs_by_default(stage: Usd.Stage, tmp_path: Path) -> None:
    scenes.bind(stage.GetPrimAtPath("/world/one"), scenes.materialx_material(stage, "/world/looks/mx", False))

    def coordinate(**plan: object) -> UsdShade.Shader:
        final, warnings = over(stage, **plan)
        assert warnings == [] and checked(tmp_path) == []
        surface = bound(final, "/world/one").ComputeSurfaceSource("mtlx")[0]
        return source(source(surface.GetInput("emission_color")).GetInput("texcoord"))

    lookup = coordinate(corners=False, form="tile")
    assert lookup.GetInput("file").Get(2).path == "./redirect.one.0002.1001.exr" and not lookup.GetInput("texcoord")
    total = coordinate(corners=False, form="delta")
    assert total.GetIdAttr().Get() == "ND_add_vector2"
    assert source(total.GetInput("in1")).GetIdAttr().Get() == "ND_texcoord_vector2"
    assert source(total.GetInput("in2")).GetInput("file").Get(1).path == "./redirect.one.0001.1001.exr"
    assert source(source(total.GetInput("in2")).GetInput("texcoord")).GetIdAttr().Get() == "ND_texcoord_vector2"
    reader = coordinate()
    assert reader.GetIdAttr().Get() == "ND_geompropvalue_vector2"
    assert reader.GetInput("geomprop").Get() == "st_redirected"


def test_materialx_of_another_uv_set_stays(stage: Usd.Stage) -> None:
    scenes.bind(stage.GetPrimAtPath("/world/one"), scenes.materialx_material(stage, "/world/looks/mx"))
    node(stage, "mx/graph/uv").GetInput("geomprop").Set("second")
    assert "mx/graph/colour is not looked up by the UVs 'st'" in over(stage)[1][0]


def test_a_coordinate_that_comes_through_the_interface_of_a_graph(stage: Usd.Stage, tmp_path: Path) -> None:
    material = scenes.materialx_material(stage, "/world/looks/mx", False)
    reader = scenes.shader(stage, "/world/looks/mx/uv", "ND_texcoord_vector2")
    port = UsdShade.NodeGraph(stage.GetPrimAtPath("/world/looks/mx/graph")).CreateInput("uv", scenes.TYPES.Float2)
    port.ConnectToSource(reader.CreateOutput("out", scenes.TYPES.Float2))
    node(stage, "mx/graph/colour").CreateInput("texcoord", scenes.TYPES.Float2).ConnectToSource(port)
    scenes.bind(stage.GetPrimAtPath("/world/one"), material)
    final, warnings = over(stage, corners=False)
    assert warnings == [] and checked(tmp_path) == [], "nodes are plugged to nodes of the same graph alone"
    made = bound(final, "/world/one")
    lookup = source(UsdShade.Shader(made.GetPrim().GetChild("graph").GetChild("colour")).GetInput("texcoord"))
    assert lookup.GetPrim().GetParent() == made.GetPrim() and lookup.GetIdAttr().Get() == "ND_image_vector2"
    assert source(lookup.GetInput("texcoord")).GetPrim().GetName() == "uv"


def test_purposes_and_subsets_keep_their_materials(stage: Usd.Stage, tmp_path: Path) -> None:
    full = scenes.preview_material(stage, "/world/looks/full", "full.png")
    nail = scenes.preview_material(stage, "/world/looks/nail", "nail.png")
    UsdShade.MaterialBindingAPI.Apply(stage.GetPrimAtPath("/world")).Bind(full, materialPurpose="full")
    api = UsdShade.MaterialBindingAPI(stage.GetPrimAtPath("/world/one"))
    scenes.bind(api.CreateMaterialBindSubset("nail", [1]).GetPrim(), nail)
    api.SetMaterialBindSubsetsFamilyType("nonOverlapping")
    final, warnings = over(stage)
    assert warnings == [] and checked(tmp_path) == []
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


def test_instanceable_materials(stage: Usd.Stage) -> None:
    stage.GetPrimAtPath("/world/looks/skin").SetInstanceable(True)
    final, warnings = over(stage)
    assert warnings == [] and varname(texture(bound(final, "/world/one"))) == "st_redirected"


def placed(stage: Usd.Stage, kind: str = "UsdTransform2d", **values: object) -> UsdShade.Shader:
    """Puts a node between the reader of the UVs of the shot's material and its texture."""
    place = scenes.shader(stage, "/world/looks/skin/place", kind)
    for name, value in values.items():
        place.CreateInput(name, scenes.TYPES.Float if name == "rotation" else scenes.TYPES.Float2).Set(value)
    place.CreateInput("in", scenes.TYPES.Float2).ConnectToSource(node(stage, "skin/uv").GetOutput("result"))
    node(stage, "skin/colour").GetInput("st").ConnectToSource(place.CreateOutput("result", scenes.TYPES.Float2))
    return place


def warped_file(stage: Usd.Stage, **plan: object) -> tuple[str, list[str]]:
    """The file that the texture of /world/one names under the layer, and the layer's warnings."""
    final, warnings = over(stage, corners=False, warped_path=lambda *_: "./warped.png", **plan)
    return file_of(final), warnings


@pytest.mark.parametrize(
    ("kind", "values"),
    [
        ("UsdTransform2d", {"rotation": 30.0}),
        ("UsdTransform2d", {"scale": (2, 2)}),
        ("UsdTransform2d", {"scale": (1, -1), "translation": (0, 1)}),
        ("UsdTransform2d", {"translation": (0.25, 0)}),
        ("StudioPlace2d", {}),
    ],
)
def test_a_texture_that_is_looked_up_by_transformed_uvs_keeps_its_file(stage: Usd.Stage, kind: str, values) -> None:
    placed(stage, kind, **values)
    file, warnings = warped_file(stage)
    assert file == "colour.<UDIM>.png"
    assert f"is looked up through /world/looks/skin/place ({kind})" in warnings[0]
    assert "neither a warped copy" not in "".join(warnings)
    # Redirected corner UVs go through the transform as the mesh's own do.
    final, warnings = over(stage, warped_path=lambda *_: "./warped.png")
    assert warnings == [] and file_of(final) == "colour.<UDIM>.png"
    reader = source(source(texture(bound(final, "/world/one")).GetInput("st")).GetInput("in"))
    (name,) = UsdShade.Utils.GetValueProducingAttributes(reader.GetInput("varname"))
    assert name.Get() == "st_redirected"


def test_a_transform_that_does_nothing_does_no_harm(stage: Usd.Stage) -> None:
    place = placed(stage, rotation=0.0, scale=(1, 1), translation=(0, 0))
    assert warped_file(stage) == ("./warped.png", [])
    # Until it is animated.
    place.GetInput("translation").Set((0.5, 0), 3)
    place.GetInput("translation").Set((0, 0), 1)
    assert warped_file(stage)[0] == "colour.<UDIM>.png"


def test_other_lookups_that_no_copy_is_made_for(stage: Usd.Stage) -> None:
    image = node(stage, "skin/colour")
    image.GetInput("file").Set(Sdf.AssetPath("colour.png"))
    image.CreateInput("wrapS", scenes.TYPES.Token).Set("mirror")
    assert warped_file(stage, tiles={"one": (1001,)}, form="delta") == ("./warped.png", [])
    file, warnings = warped_file(stage, tiles={"one": (1002,)}, form="delta")
    assert file == "colour.png" and "is mirrored by its wrapS" in warnings[0]
    image.GetInput("wrapS").Set("repeat")
    assert warped_file(stage, tiles={"one": (1002,)}, form="delta")[0] == "./warped.png"
    # A sequence of textures.
    image.GetInput("file").Set(Sdf.AssetPath("colour.1.png"), 1)
    image.GetInput("file").Set(Sdf.AssetPath("colour.2.png"), 2)
    file, warnings = warped_file(stage)
    assert file == "colour.2.png" and "is another file from frame to frame" in warnings[0]
    # At one place, whatever the UVs.
    image.GetInput("file").GetAttr().Clear()
    image.GetInput("file").Set(Sdf.AssetPath("colour.png"))
    image.GetInput("st").ClearSources()
    image.GetInput("st").Set((0.5, 0.5))
    file, warnings = warped_file(stage)
    assert file == "colour.png" and "is looked up at one place" in warnings[0]


def test_a_texture_without_a_copy_stays_beside_one_that_has_it(stage: Usd.Stage) -> None:
    other = scenes.shader(stage, "/world/looks/skin/rough", "UsdUVTexture")
    other.CreateInput("file", scenes.TYPES.Asset).Set(Sdf.AssetPath("rough.png"))
    other.CreateInput("st", scenes.TYPES.Float2).ConnectToSource(node(stage, "skin/uv").GetOutput("result"))
    rough = node(stage, "skin/surface").CreateInput("roughness", scenes.TYPES.Float)
    rough.ConnectToSource(other.CreateOutput("r", scenes.TYPES.Float))

    def warped(shape: str, frame: int, name: str) -> str | None:
        return "./warped.png" if "colour" in name else None

    final, warnings = over(stage, corners=False, warped_path=warped)
    assert file_of(final) == "./warped.png"
    assert len(warnings) == 1 and "rough has neither a warped copy" in warnings[0]
