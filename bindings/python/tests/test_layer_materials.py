"""Materials under a layer: which textures are looked up where, and what cannot be."""

from pathlib import Path

import pytest
from pxr import Sdf, Usd, UsdGeom, UsdShade

import scenes
from shots import bake, bound, checked, composed, shot, source, texture, varname
from vrtm.bake.scene import Scene


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
    assert len(warnings) == 1 and "/world/looks/skin/colour has neither a warped copy nor redirected" in warnings[0]
    final = composed(tmp_path)
    assert bound(final, "/world/one").GetPath() == "/world/looks/skin"
    assert not final.GetPrimAtPath("/world/looks/skin_one_redirected")
    _, warnings = bake(tmp_path, scene, ("two", "three"))
    assert (
        "/world/two: the texture /world/looks/other/colour is looked up by 'second', not by the UVs 'st'" in warnings[0]
    )
    assert warnings[-1] == "/world/three: no material is bound to it"


def test_a_warped_copy_is_not_wired_in_where_another_uv_set_is_looked_up(tmp_path: Path) -> None:
    stage = shot(tmp_path)
    scenes.bind(stage.GetPrimAtPath("/world/two"), scenes.preview_material(stage, "/world/looks/other", uv="second"))
    stage.Save()
    _, warnings = bake(
        tmp_path, Scene(tmp_path / "shot.usda"), ("two",), corners=False, warped_path=lambda *_: "./warped.png"
    )
    assert [warning for warning in warnings if "is looked up by 'second', not by the UVs 'st'" in warning] == warnings[
        :1
    ]
    assert "neither a warped copy" not in "".join(warnings)
    assert texture(bound(composed(tmp_path), "/world/two")).GetInput("file").Get(2).path == "colour.<UDIM>.png"


def test_a_normal_map_that_stays_is_not_said_to_be_redirected(tmp_path: Path) -> None:
    stage = shot(tmp_path)
    for uv in ("st", "second"):
        material = scenes.preview_material(stage, f"/world/looks/{uv}", uv=uv)
        surface = UsdShade.Shader(stage.GetPrimAtPath(f"/world/looks/{uv}/surface"))
        normal = surface.CreateInput("normal", scenes.TYPES.Normal3f)
        normal.ConnectToSource(UsdShade.Shader(stage.GetPrimAtPath(f"/world/looks/{uv}/colour")).GetOutput("rgb"))
        scenes.bind(stage.GetPrimAtPath("/world/one" if uv == "st" else "/world/two"), material)
    stage.Save()
    _, warnings = bake(tmp_path, Scene(tmp_path / "shot.usda"), ("one", "two"), mode="primvar")
    told = [warning for warning in warnings if "redirected, but does not turn" in warning]
    assert len(told) == 1 and told[0].startswith("/world/one: ")
    # A warped copy is turned by who warps it.
    _, warnings = bake(
        tmp_path, Scene(tmp_path / "shot.usda"), ("one",), corners=False, warped_path=lambda *_: "./warped.png"
    )
    assert not warnings


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
    assert "mx/graph/colour is not looked up by the UVs 'st'" in warnings[0]


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
        "/world/one: a stronger binding keeps /world/looks/other instead of /world/looks/other_one_redirected"
    ]


def test_instanceable_materials(tmp_path: Path) -> None:
    stage = shot(tmp_path)
    stage.GetPrimAtPath("/world/looks/skin").SetInstanceable(True)
    stage.Save()
    _, warnings = bake(tmp_path, Scene(tmp_path / "shot.usda"))
    assert warnings == [] and varname(texture(bound(composed(tmp_path), "/world/one"))) == "st_redirected"


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


def placed(stage: Usd.Stage, path: str, node: str = "UsdTransform2d", **values: object) -> None:
    """Puts a node between the reader of the UVs of `preview_material` and its texture."""
    place = scenes.shader(stage, f"{path}/place", node)
    kinds = {"rotation": scenes.TYPES.Float}
    for name, value in values.items():
        place.CreateInput(name, kinds.get(name, scenes.TYPES.Float2)).Set(value)
    reader = UsdShade.Shader(stage.GetPrimAtPath(f"{path}/uv"))
    place.CreateInput("in", scenes.TYPES.Float2).ConnectToSource(reader.GetOutput("result"))
    image = UsdShade.Shader(stage.GetPrimAtPath(f"{path}/colour"))
    image.GetInput("st").ConnectToSource(place.CreateOutput("result", scenes.TYPES.Float2))


def warped_file(folder: Path, **plan: object) -> tuple[str, list[str]]:
    """The file that the texture of /world/one names under the layer, and the layer's warnings."""
    scene = Scene(folder / "shot.usda")
    _, warnings = bake(folder, scene, corners=False, warped_path=lambda *_: "./warped.png", **plan)
    return texture(bound(composed(folder), "/world/one")).GetInput("file").Get(2).path, warnings


@pytest.mark.parametrize(
    ("node", "values"),
    [
        ("UsdTransform2d", {"rotation": 30.0}),
        ("UsdTransform2d", {"scale": (2, 2)}),
        ("UsdTransform2d", {"scale": (1, -1), "translation": (0, 1)}),
        ("UsdTransform2d", {"translation": (0.25, 0)}),
        ("StudioPlace2d", {}),
    ],
)
def test_a_texture_that_is_looked_up_by_transformed_uvs_keeps_its_file(
    tmp_path: Path, node: str, values: dict[str, object]
) -> None:
    stage = shot(tmp_path)
    placed(stage, "/world/looks/skin", node, **values)
    stage.Save()
    file, warnings = warped_file(tmp_path)
    assert file == "colour.<UDIM>.png"
    assert f"is looked up through /world/looks/skin/place ({node})" in warnings[0]
    assert "neither a warped copy" not in "".join(warnings)
    # Redirected corner UVs go through the transform as the mesh's own do.
    _, warnings = bake(
        tmp_path, Scene(tmp_path / "shot.usda"), warped_path=lambda *_: "./warped.png", mode="both", form="udim"
    )
    image = texture(bound(composed(tmp_path), "/world/one"))
    assert warnings == [] and image.GetInput("file").Get(2).path == "colour.<UDIM>.png"
    reader = source(source(image.GetInput("st")).GetInput("in"))
    (name,) = UsdShade.Utils.GetValueProducingAttributes(reader.GetInput("varname"))
    assert name.Get() == "st_redirected"


def test_a_transform_that_does_nothing_does_no_harm(tmp_path: Path) -> None:
    stage = shot(tmp_path)
    placed(stage, "/world/looks/skin", rotation=0.0, scale=(1, 1), translation=(0, 0))
    stage.Save()
    assert warped_file(tmp_path) == ("./warped.png", [])
    # Until it is animated.
    UsdShade.Shader(stage.GetPrimAtPath("/world/looks/skin/place")).GetInput("translation").Set((0.5, 0), 3)
    UsdShade.Shader(stage.GetPrimAtPath("/world/looks/skin/place")).GetInput("translation").Set((0, 0), 1)
    stage.Save()
    assert warped_file(tmp_path)[0] == "colour.<UDIM>.png"


def test_other_lookups_that_no_copy_is_made_for(tmp_path: Path) -> None:
    stage = shot(tmp_path)
    image = UsdShade.Shader(stage.GetPrimAtPath("/world/looks/skin/colour"))
    image.GetInput("file").Set(Sdf.AssetPath("colour.png"))
    image.CreateInput("wrapS", scenes.TYPES.Token).Set("mirror")
    stage.Save()
    assert warped_file(tmp_path, tiles={"one": (1001,)}, form="delta") == ("./warped.png", [])
    file, warnings = warped_file(tmp_path, tiles={"one": (1002,)}, form="delta")
    assert file == "colour.png" and "is mirrored by its wrapS" in warnings[0]
    image.GetInput("wrapS").Set("repeat")
    stage.Save()
    assert warped_file(tmp_path, tiles={"one": (1002,)}, form="delta")[0] == "./warped.png"
    # A sequence of textures.
    image.GetInput("file").Set(Sdf.AssetPath("colour.1.png"), 1)
    image.GetInput("file").Set(Sdf.AssetPath("colour.2.png"), 2)
    stage.Save()
    file, warnings = warped_file(tmp_path)
    assert file == "colour.2.png" and "is another file from frame to frame" in warnings[0]
    # At one place, whatever the UVs.
    image.GetInput("file").GetAttr().Clear()
    image.GetInput("file").Set(Sdf.AssetPath("colour.png"))
    image.GetInput("st").ClearSources()
    image.GetInput("st").Set((0.5, 0.5))
    stage.Save()
    file, warnings = warped_file(tmp_path)
    assert file == "colour.png" and "is looked up at one place" in warnings[0]


def test_textures_of_one_reader_are_redirected_in_one_way(tmp_path: Path) -> None:
    stage = shot(tmp_path)
    reader = UsdShade.Shader(stage.GetPrimAtPath("/world/looks/skin/uv"))
    other = scenes.shader(stage, "/world/looks/skin/rough", "UsdUVTexture")
    other.CreateInput("file", scenes.TYPES.Asset).Set(Sdf.AssetPath("rough.png"))
    other.CreateInput("st", scenes.TYPES.Float2).ConnectToSource(reader.GetOutput("result"))
    surface = UsdShade.Shader(stage.GetPrimAtPath("/world/looks/skin/surface"))
    rough = other.CreateOutput("r", scenes.TYPES.Float)
    surface.CreateInput("roughness", scenes.TYPES.Float).ConnectToSource(rough)
    stage.Save()
    scene = Scene(tmp_path / "shot.usda")

    def warped(shape: str, frame: int, name: str) -> str | None:
        return "./warped.png" if "colour" in name else None

    _, warnings = bake(tmp_path, scene, mode="both", warped_path=warped)
    image = texture(bound(composed(tmp_path), "/world/one"))
    # Else the warped copy would be looked up by redirected UVs.
    assert varname(image) == "st_redirected" and image.GetInput("file").Get(2).path == "colour.<UDIM>.png"
    assert warnings == []
    _, warnings = bake(tmp_path, scene, corners=False, warped_path=warped)
    assert texture(bound(composed(tmp_path), "/world/one")).GetInput("file").Get(2).path == "./warped.png"
    assert len(warnings) == 1 and "rough has neither a warped copy" in warnings[0]
