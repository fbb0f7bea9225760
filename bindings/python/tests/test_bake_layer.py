"""The layer that a bake writes: files that it names, corner UVs, root layers, frozen frames, what USD cannot open."""

from pathlib import Path

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdGeom, UsdShade

from bake_scenes import MESH, files, run, sheet, sheet_arguments, solved_alone, with_copies, with_material, written
from scenes import preview_material
from shots import bound, check_layer, texture


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return with_material(tmp_path_factory.mktemp("sheet"), preview_material, 5, 8)


def test_corner_uvs_are_up_to_date_or_made_anew(scene: Path, tmp_path: Path) -> None:
    layer = tmp_path / "redirect.usda"
    options = ("--form", "udim", "--layer", layer, "--layer-mode", "primvar", "--frames", "1-2")
    maps = tmp_path / "maps"
    assert written(run(*sheet_arguments(scene, maps, *options, "--jobs", 2))) == (6, 0)
    before = files(tmp_path)
    assert written(run(*sheet_arguments(scene, maps, *options))) == (0, 6)
    corners = maps / "corners.0002.usdc"
    whole = corners.read_bytes()
    other = (maps / "corners.0001.usdc").read_bytes()
    for damage in (b"", whole[:200], whole[:-30], other, b"PXR-USDC" + bytes(len(whole))):
        corners.write_bytes(damage)
        assert written(run(*sheet_arguments(scene, maps, *options))) == (1, 5)
        assert files(tmp_path) == before


def test_a_layer_names_files_that_exist(tmp_path: Path) -> None:
    scene = with_material(tmp_path / "shot")
    layer = tmp_path / "over.usda"
    arguments = sheet_arguments(scene, tmp_path / "maps", "--layer", layer)
    ended = run(*arguments, "--tiles", 1001, expect=3)
    last = ended.stderr.splitlines()[-1]
    assert "3 of the files that it names do not exist, such as " in last and "redirect.0001.1002.exr" in last
    run(*arguments)
    run(*arguments, "--tiles", 1001)
    (tmp_path / "maps" / "redirect.0002.1001.exr").unlink()
    assert "1 of the files" in run(*arguments, "--only-layer", expect=3).stderr
    run(*arguments, "--only-layer", "--frames", "1,3")
    # Of copies, those of textures that are looked up; of corner UVs, those of the frames.
    scene = with_material(tmp_path / "preview", preview_material)
    copies = sheet_arguments(scene, tmp_path / "copies", "--layer", tmp_path / "preview.usda")
    copies += ["--texture", scene.parent / "colour.<UDIM>.png"]
    run(*copies)
    (tmp_path / "copies" / "redirect.0001.1001.exr").unlink()
    run(*copies, "--only-layer")
    (tmp_path / "copies" / "colour.0002.1002.png").unlink()
    assert "colour.0002.1002.png" in run(*copies, "--only-layer", expect=3).stderr
    corners = sheet_arguments(scene, tmp_path / "st", "--layer", tmp_path / "st.usda", "--layer-mode", "primvar")
    run(*corners)
    (tmp_path / "st" / "corners.0003.usdc").unlink()
    assert "corners.0003.usdc" in run(*corners, "--only-layer", expect=3).stderr


def looked_up(stage: Usd.Stage) -> Usd.Attribute:
    material = bound(stage, MESH)
    (image,) = [prim for prim in Usd.PrimRange(material.GetPrim()) if prim.GetName() == "vrtm_redirected"]
    return UsdShade.Shader(image).GetInput("file").GetAttr()


def test_a_root_can_be_opened_by_itself(tmp_path: Path) -> None:
    scene = with_material(tmp_path / "shot")
    root = tmp_path / "final" / "root.usda"
    root.parent.mkdir()
    arguments = sheet_arguments(scene, tmp_path / "maps", "--layer", tmp_path / "over.usda", "--root", root)
    run(*arguments)
    stage = Usd.Stage.Open(str(root))
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode(), stage.GetTimeCodesPerSecond()) == (1, 3, 60)
    assert UsdGeom.GetStageUpAxis(stage) == "Z" and UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    assert stage.GetDefaultPrim().GetPath() == "/model"
    assert stage.GetRootLayer().subLayerPaths == ["../over.usda", "../shot/sheet.usda"]
    assert looked_up(stage).Get(2).path == "./maps/redirect.0002.<UDIM>.exr"
    # The test's material looks for a texture that is not there.
    assert all("colour.<UDIM>.exr" in complaint for complaint in check_layer(root))
    run(*arguments)
    root.write_text('#usda 1.0\ndef "mine" {}\n')
    assert "--root" in run(*arguments, expect=2).stderr and "mine" in root.read_text()


def test_a_frame_is_frozen_for_programs_that_ignore_time(tmp_path: Path) -> None:
    scene = with_material(tmp_path / "shot")
    layer, root = tmp_path / "over.usda", tmp_path / "root.usda"
    arguments = sheet_arguments(scene, tmp_path / "maps", "--layer", layer, "--root", root, "--freeze", 2)
    run(*arguments)
    stage = Usd.Stage.Open(str(root))
    file = looked_up(stage)
    assert not file.GetTimeSamples() and file.Get().path == file.Get(3).path == "./maps/redirect.0002.<UDIM>.exr"
    assert "--freeze 9: it is none of 1-3" in run(*arguments, "--freeze", 9, expect=2).stderr
    scene = with_material(tmp_path / "preview", preview_material)
    stages = []
    for mode, more in (("texture", ("--texture", scene.parent / "colour.<UDIM>.png")), ("primvar", ())):
        root = tmp_path / f"{mode}.root.usda"
        given = ("--layer", tmp_path / f"{mode}.usda", "--root", root, "--freeze", 3, "--layer-mode", mode, *more)
        run(*sheet_arguments(scene, tmp_path / "copies", *given, "--seams", "shut", "--open-borders", "fixed"))
        stages.append(Usd.Stage.Open(str(root)))
    assert texture(bound(stages[0], MESH)).GetInput("file").Get().path == "./copies/colour.0003.<UDIM>.png"
    primvar = UsdGeom.PrimvarsAPI(stages[1].GetPrimAtPath(MESH)).GetPrimvar("st_redirected")
    alone = solved_alone(scene, 3).corner_uvs()
    assert all(np.array_equal(np.array(primvar.Get(frame)), alone) for frame in (1, 2, 3))


def test_what_a_build_of_usd_cannot_open_is_said_once(tmp_path: Path) -> None:
    if Sdf.FileFormat.FindByExtension("mtlx"):
        pytest.skip("skipped: this build of USD opens .mtlx")
    scene = sheet(tmp_path / "shot", frames=1, cells=4)
    stage = with_copies(scene, "second", "third")
    stage.GetPrimAtPath("/model").GetReferences().AddReference("./looks.mtlx", "/MaterialX/Materials")
    for name in ("sheet", "second", "third"):
        prim = stage.GetPrimAtPath(f"/model/{name}")
        UsdShade.MaterialBindingAPI.Apply(prim)
        prim.CreateRelationship("material:binding").SetTargets([f"/model/{name}_look"])
    stage.Save()
    (scene.parent / "looks.mtlx").write_text('<?xml version="1.0"?><materialx version="1.38"></materialx>')
    ended = run(*sheet_arguments(scene, tmp_path / "out", "--layer", tmp_path / "over.usda"), expect=2)
    told = [line for line in ended.stderr.splitlines() if line.startswith("vrtm: warning: ")]
    (missing,) = [line for line in told if "looks.mtlx" in line]
    assert "what it takes from ./looks.mtlx is missing: this build of USD (" in missing and "opens no .mtlx" in missing
    (material,) = [line for line in told if "is not in the scene" in line]
    assert material.startswith("vrtm: warning: /model/sheet and 2 other meshes: material /model/sheet_look is not")
    assert "no material is bound" not in ended.stderr
