"""Maps that are solved in one UV set and hold UVs of another, by which the textures are looked up."""

from pathlib import Path

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdGeom, UsdShade

from bake_scenes import attributes, files, pixels, run, sheet, sheet_arguments, solved_alone
from mirrored import CELLS, MESH, SIZE, composed, materials, mirrored
from vrtm.bake.scene import Scene, SceneOptions


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
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


def arguments(scene: Path, out: Path, *more: object) -> list[object]:
    return sheet_arguments(scene, out, "--uv", "unique", "--texture-uv", "st", "--frames", 2, *more)


@pytest.mark.parametrize("form", ["udim", "delta"])
def test_maps_hold_uvs_of_the_other_set(scene: Path, tmp_path: Path, form: str) -> None:
    given = arguments(scene, tmp_path / "maps", "--form", form, "--layer", tmp_path / "over.usda", "--measure")
    run(*given)
    options = SceneOptions(uv="unique", texture_uv="st")
    with Scene(scene, options) as opened:
        (shape,) = opened.shapes
    asset = solved_alone(scene, 2, SIZE, options=options, uv_sets=[shape.texture_uvs])
    assert set(files(tmp_path / "maps")) == {f"redirect.0002.{udim}.exr" for udim in (1001, 1002)}
    for udim in (1001, 1002):
        path = tmp_path / "maps" / f"redirect.0002.{udim}.exr"
        kind = "uv_set" if form == "udim" else "uv_set_delta"
        assert np.array_equal(pixels(path), asset.tile(udim).fetch(kind, SIZE, channels=3, uv_set=1))
        assert attributes(path)["vrtm:texture_uv"] == "st"
    assert "0 files written, 2 up to date" in run(*given).stdout
    # The map is looked up by the set that it was solved in, and takes the place of the other.
    stage = composed(scene, tmp_path / "over.usda")
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


def test_what_the_other_set_does_not_have_is_refused(scene: Path, tmp_path: Path) -> None:
    for more in (
        ("--form", "tile"),
        ("--texture", scene.parent / "colour.<UDIM>.png"),
        ("--jacobian",),
        ("--layer", tmp_path / "over.usda", "--layer-mode", "primvar"),
        ("--subdivide", 1),
    ):
        ended = run(*arguments(scene, tmp_path / "out", *more), expect=2)
        assert "--texture-uv and --" in ended.stderr and "exclude each other" in ended.stderr
    ended = run(*arguments(scene, tmp_path / "out", "--texture-uv", "uniqe"), expect=2)
    assert "has no UVs 'uniqe' that textures are looked up by: did you mean unique?" in ended.stderr
    plain = sheet(tmp_path / "plain", frames=2)
    assert "no UVs 'other'" in run(*sheet_arguments(plain, tmp_path / "out", "--texture-uv", "other"), expect=2).stderr
    assert not (tmp_path / "out").exists()
