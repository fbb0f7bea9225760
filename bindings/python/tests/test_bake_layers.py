"""Charts that lie over one another: maps, copies of textures, materials and figures of each layer; and maps that are
solved in one UV set and hold UVs of another, by which the textures are looked up."""

from pathlib import Path

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdGeom, UsdShade, Vt

import scenes
import vrtm
from bake_scenes import attributes, files, pixels, run, sheet, sheet_arguments, solved_alone
from mirrored import CELLS, MESH, SIZE, check_family, looked_up, materials, mirrored
from shots import check_layer, composed
from vrtm.bake.names import ONE_MESH, SEVERAL, Pattern
from vrtm.bake.report import advice
from vrtm.bake.scene import Scene, SceneOptions
from vrtm.bake.settings import Settings


def solved(scene: Path, frame: int, subdivide: int = 0, **mesh: object) -> vrtm.Asset:
    """A frame, solved by the library without the command."""
    return solved_alone(scene, frame, SIZE, options=SceneOptions(subdivide=subdivide), **{"max_layers": 32} | mesh)


@pytest.fixture(scope="module")
def baked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The mirrored model's scene, and beside it the maps, the copies of a texture and the layer."""
    folder = tmp_path_factory.mktemp("mirrored")
    scene = mirrored(folder / "shot")
    borders = ("--seams", "shut", "--open-borders", "fixed")
    run(*arguments(scene, folder / "maps", *borders))
    return scene


def arguments(scene: Path, out: Path, *more: object) -> list[object]:
    options = ("--texture", scene.parent / "colour.<UDIM>.png", "--layer", out.parent / "over.usda", "--measure")
    return sheet_arguments(scene, out, "--form", "udim", *options, *more)


def test_each_layer_has_the_maps_of_its_tile(baked: Path) -> None:
    out = baked.parents[1] / "maps"
    assert set(files(out)) == {
        f"{kind}{tile[:-5]}.000{frame}.{tile[-4:]}.{ending}"
        for kind, ending in (("redirect", "exr"), ("colour", "png"))
        for tile in (".1001", "_layer1.1001", ".1002")
        for frame in (1, 2)
    }
    asset = solved(baked, 2)
    assert [(tile.udim, tile.layer) for tile in asset.tiles] == [(1001, 0), (1001, 1), (1002, 0)]
    for tile in asset.tiles:
        mark = f"_layer{tile.layer}" if tile.layer else ""
        path = out / f"redirect{mark}.0002.{tile.udim}.exr"
        expected = tile.fetch("redirection_udim", SIZE, channels=3)
        assert np.array_equal(pixels(path), expected)
        assert attributes(path).get("vrtm:layer") == (tile.layer or None)
    copies = [pixels(out / f"colour{mark}.0002.1001.png") for mark in ("", "_layer1")]
    assert not np.array_equal(*copies)


def test_messages_name_the_layer(baked: Path, tmp_path: Path) -> None:
    ended = run(*arguments(baked, tmp_path / "maps", "--frames", 2, "--max-strain", 0.001), expect=3)
    assert f"{MESH} tile 1001 layer 1: 0.0% of the rigid texels are fixed" in ended.stdout
    assert "--max-strain 0.001 was exceeded in 3 of 3: mirrored, frame 2, tile 1001 layer " in ended.stderr
    said = f"{MESH}: its UVs lie over one another in 2 layers"
    assert said not in ended.stdout
    plain = run(*sheet_arguments(baked, tmp_path / "plain", "--dry-run"))
    assert said in plain.stdout
    ended = run(*arguments(baked, tmp_path / "dry", "--dry-run"))
    assert "  tile 1001 layer 1: grid" in ended.stdout and "  tile 1002: grid" in ended.stdout
    assert not (tmp_path / "dry").exists()
    assert "--overlap" in run(*arguments(baked, tmp_path / "no", "--overlap", "last"), expect=2).stderr


def test_the_first_face_moves_all(baked: Path, tmp_path: Path) -> None:
    more = ("--frames", 2, "--tiles", 1001, "--layer", "", "--overlap", "first")
    run(*arguments(baked, tmp_path / "first", *more))
    asset = solved_alone(baked, 2, SIZE, settings={"overlap": "first_face"})
    expected = asset.tile(1001).fetch("redirection_udim", SIZE, channels=3)
    assert np.array_equal(pixels(tmp_path / "first" / "redirect.0002.1001.exr"), expected)


def test_the_layer_binds_the_maps_of_each_layer(baked: Path) -> None:
    layers = solved(baked, 2).face_layers()
    over = baked.parents[1] / "over.usda"
    stage = composed(baked, over)
    primvar = UsdGeom.PrimvarsAPI(stage.GetPrimAtPath(MESH)).GetPrimvar("vrtmLayer")
    assert primvar.GetInterpolation() == "uniform" and primvar.GetTypeName() == "int[]"
    assert np.array_equal(primvar.Get(), layers) and sorted(set(layers)) == [0, 1]
    found = materials(stage)
    check_family(stage, "nonOverlapping")
    assert set(found) == {"", "vrtm_layer1"}
    for name, mark, layer in (("", "", 0), ("vrtm_layer1", "_layer1", 1)):
        faces, material = found[name]
        assert np.array_equal(faces, np.flatnonzero(layers == layer))
        assert material.GetPath() == f"/model/skin_mirrored_redirected{mark}"
        assert looked_up(material) == f"./maps/redirect{mark}.0002.<UDIM>.exr"
    # The test's material looks for a texture that is not there.
    assert all("colour.<UDIM>.exr" in complaint for complaint in check_layer(over, baked))


def test_subsets_of_the_shot_are_divided(tmp_path: Path) -> None:
    """Of three subsets, one lies in both layers, one in the second alone, and one in the first."""
    scene = mirrored(tmp_path / "shot", make=scenes.preview_material)
    stage = Usd.Stage.Open(str(scene))
    mesh = stage.GetPrimAtPath(MESH)
    half = CELLS * CELLS
    upper = np.arange(half // 2, half)
    subsets = {
        "both": [*upper, *(upper + half)],
        "second": list(range(half, half + 24)),
        "apart": list(range(2 * half, 3 * half)),
    }
    for name, own in subsets.items():
        indices = Vt.IntArray([int(face) for face in own])
        subset = UsdShade.MaterialBindingAPI(mesh).CreateMaterialBindSubset(name, indices)
        scenes.bind(subset.GetPrim(), scenes.preview_material(stage, f"/model/{name}"))
    stage.Save()
    over = tmp_path / "over.usda"
    run(*arguments(scene, tmp_path / "maps"))
    stage = composed(scene, over)
    found = materials(stage)
    check_family(stage, "nonOverlapping")
    layers = solved(scene, 2).face_layers()
    expected = {
        "": ("skin", range(half // 2), ""),
        "vrtm_layer1": ("skin", range(half + 24, half + half // 2), "_layer1"),
        "both": ("both", upper, ""),
        "both_vrtm_layer1": ("both", upper + half, "_layer1"),
        "second": ("second", range(half, half + 24), "_layer1"),
        "apart": ("apart", range(2 * half, 3 * half), ""),
    }
    assert set(found) == set(expected)
    for name, (base, own, mark) in expected.items():
        faces, material = found[name]
        assert np.array_equal(np.sort(faces), own), name
        assert (layers[faces] == (1 if mark else 0)).all()
        assert material.GetPath() == f"/model/{base}_mirrored_redirected{mark}", name
        assert looked_up(material) == f"./maps/colour{mark}.0002.<UDIM>.png", name
    assert all("colour.1001" in c or "colour.<UDIM>" in c for c in check_layer(over, scene))
    # Corner UVs are those of all layers at once: they need neither subsets nor further materials.
    run(*arguments(scene, tmp_path / "maps", "--layer-mode", "primvar", "--layer", tmp_path / "st.usda"))
    stage = composed(scene, tmp_path / "st.usda")
    assert set(materials(stage)) == {"", *subsets}
    corners = UsdGeom.PrimvarsAPI(stage.GetPrimAtPath(MESH)).GetPrimvar("st_redirected").Get(2)
    assert np.array_equal(np.array(corners), solved(scene, 2).corner_uvs())


def test_layers_of_a_refined_mesh_are_those_of_its_cage(tmp_path: Path) -> None:
    scene = mirrored(tmp_path / "shot", frames=1, scheme="catmullClark")
    run(*arguments(scene, tmp_path / "maps", "--subdivide", 2, "--frames", 1))
    stage = composed(scene, tmp_path / "over.usda")
    layers = np.array(UsdGeom.PrimvarsAPI(stage.GetPrimAtPath(MESH)).GetPrimvar("vrtmLayer").Get())
    assert np.array_equal(layers, np.repeat([0, 1, 0], CELLS * CELLS))
    assert np.array_equal(np.repeat(layers, 16), solved(scene, 1, 2).face_layers())


@pytest.mark.parametrize(
    ("settings", "overlapped", "layers", "told"),
    [
        ({"overlap": "fixed"}, 0.8, 1, "--overlap each"),
        ({"max_layers": 2}, 0.8, 2, "--max-layers"),
        ({"max_layers": 3}, 0.8, 2, "laid out anew"),
        ({}, 0.1, 1, "--seams continue"),
        ({"overlap": "first"}, 0.8, 1, "--seams continue"),
        ({"mask": "mask.png", "seams": "continue"}, 0.1, 1, "the mask is dark"),
        ({"seams": "continue"}, 0.0, 1, "the surface ends"),
    ],
)
def test_what_helps_where_most_is_frozen(settings: dict, overlapped: float, layers: int, told: str) -> None:
    row = {"layers": layers, "rigid": {"overlapped": overlapped, "fixed": 0.9}}
    found = advice(Settings("shot.usda", **settings), row)
    assert told in found
    if told != "the mask is dark":
        assert "the mask" not in found


def test_names() -> None:
    counts = {"<mesh>": 2, "<kind>": 1, "<frame>": 5, "<UDIM>": 2}
    assert Pattern(SEVERAL, counts).name("head", "redirect", 7, 1001) == "head.redirect.0007.1001.exr"
    assert Pattern(ONE_MESH, {}).name("head", "warp", -2.25, 1011) == "warp.-0002.25.1011.exr"
    assert Pattern(ONE_MESH, {}).name("head", "albedo", 1, "<UDIM>", ".png") == "albedo.0001.<UDIM>.png"
    # What stands for a placeholder is not looked through again.
    assert Pattern("<mesh>/<kind>.exr", {}).name("<kind>", "k", 1, 1001) == "<kind>/k.exr"
    for pattern, expected in (
        (ONE_MESH, "redirect_layer2.0007.1001.exr"),
        ("<UDIM>/<kind>.exr", "1001/redirect_layer2.exr"),
        ("<mesh>.<frame>.<UDIM>.exr", "head_layer2.0007.1001.exr"),
        ("<frame>/<UDIM>.exr", "0007/layer2.1001.exr"),
        ("maps/<UDIM>_<frame>.exr", "maps/layer2.1001_0007.exr"),
        ("<UDIM>/<mesh>.exr", "1001/head_layer2.exr"),
    ):
        made = Pattern(pattern, {})
        assert made.name("head", "redirect", 7, 1001, layer=2) == expected
        assert made.name("head", "redirect", 7, 1001) == expected.replace("_layer2", "").replace("layer2.", "")


@pytest.fixture(scope="module")
def unique(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The mirrored model, with a UV set `unique` in which its halves lie side by side."""
    made = mirrored(tmp_path_factory.mktemp("shot"))
    stage = Usd.Stage.Open(str(made))
    primvars = UsdGeom.PrimvarsAPI(stage.GetPrimAtPath(MESH))
    uvs = np.array(primvars.GetPrimvar("st").Get())
    half = CELLS * CELLS * 4
    uvs[:half, 0] = 0.5 + uvs[:half, 0] / 2
    uvs[half : 2 * half, 0] = 0.5 - uvs[half : 2 * half, 0] / 2
    primvars.CreatePrimvar("unique", Sdf.ValueTypeNames.TexCoord2fArray, "faceVarying").Set(uvs)
    stage.Save()
    return made


def in_two_sets(scene: Path, out: Path, *more: object) -> list[object]:
    return sheet_arguments(scene, out, "--uv", "unique", "--texture-uv", "st", "--frames", 2, *more)


@pytest.mark.parametrize("form", ["udim", "delta"])
def test_maps_hold_uvs_of_the_other_set(unique: Path, tmp_path: Path, form: str) -> None:
    given = in_two_sets(unique, tmp_path / "maps", "--form", form, "--layer", tmp_path / "over.usda", "--measure")
    run(*given)
    options = SceneOptions(uv=("unique",), texture_uv="st")
    with Scene(unique, options) as opened:
        (shape,) = opened.shapes
    asset = solved_alone(unique, 2, SIZE, options=options, uv_sets=[shape.texture_uvs])
    assert set(files(tmp_path / "maps")) == {f"redirect.0002.{udim}.exr" for udim in (1001, 1002)}
    for udim in (1001, 1002):
        path = tmp_path / "maps" / f"redirect.0002.{udim}.exr"
        kind = "uv_set" if form == "udim" else "uv_set_delta"
        assert np.array_equal(pixels(path), asset.tile(udim).fetch(kind, SIZE, channels=3, uv_set=1))
        assert attributes(path)["vrtm:texture_uv"] == "st"
    # The first half lies to the right of the middle there, half as wide.
    own = asset.tile(1001).fetch("redirection", SIZE, channels=4)[:, SIZE // 2 :]
    led = asset.tile(1001).fetch("uv_set", SIZE, uv_set=1)[:, SIZE // 2 :]
    assert np.abs(led - own[..., :2] * [2, 1] + [1, 0])[own[..., 3] > 0].max() < 1e-5
    assert "0 files written, 2 up to date" in run(*given).stdout
    # The map is looked up by the set that it was solved in, and takes the place of the other.
    stage = composed(unique, tmp_path / "over.usda")
    (_, material), *others = materials(stage).values()
    assert not others
    nodes = {prim.GetName(): UsdShade.Shader(prim) for prim in Usd.PrimRange(material.GetPrim())}
    (source,) = nodes["vrtm_redirected"].GetInput("texcoord").GetConnectedSources()[0]
    assert UsdShade.Shader(source.source.GetPrim()).GetInput("geomprop").Get() == "unique"
    (coordinate,) = nodes["scale"].GetInput("in1").GetConnectedSources()[0]
    name = "vrtm_redirected" if form == "udim" else "vrtm_redirected_sum"
    assert coordinate.source.GetPrim().GetName() == name
    if form == "delta":
        (own,) = nodes[name].GetInput("in1").GetConnectedSources()[0]
        assert UsdShade.Shader(own.source.GetPrim()).GetInput("geomprop").Get() == "st"


def test_what_the_other_set_does_not_have_is_refused(unique: Path, tmp_path: Path) -> None:
    for more in (
        ("--form", "tile"),
        ("--texture", unique.parent / "colour.<UDIM>.png"),
        ("--jacobian",),
        ("--layer", tmp_path / "over.usda", "--layer-mode", "primvar"),
        ("--subdivide", 1),
    ):
        ended = run(*in_two_sets(unique, tmp_path / "out", *more), expect=2)
        assert "--texture-uv and --" in ended.stderr and "exclude each other" in ended.stderr
    ended = run(*in_two_sets(unique, tmp_path / "out", "--texture-uv", "uniqe"), expect=2)
    assert "has no UVs 'uniqe' for its textures: did you mean unique?" in ended.stderr
    plain = sheet(tmp_path / "plain", frames=2)
    assert "no UVs 'other'" in run(*sheet_arguments(plain, tmp_path / "out", "--texture-uv", "other"), expect=2).stderr
    assert not (tmp_path / "out").exists()
