"""Subsets of a mesh that are baked each by itself: maps, names, figures, materials and corner UVs."""

import json
from pathlib import Path

import numpy as np
import pytest
from pxr import Usd, UsdGeom, UsdShade, Vt

import scenes
import vrtm
from bake_scenes import attributes, files, image, pixels, run, sheet, sheet_arguments, solved_alone
from mirrored import CELLS, MESH, SIZE, check_family, looked_up, materials, mirrored
from shots import composed
from vrtm.bake.scene import Scene, SceneOptions

HALF = CELLS * CELLS
FACES = {"left": np.arange(HALF), "right": np.arange(HALF, 2 * HALF), "rest": np.arange(2 * HALF, 3 * HALF)}
TILE = {"left": 1001, "right": 1001, "rest": 1002}


def two_materials(folder: Path, make=scenes.materialx_material, scheme: str = "none") -> Path:
    """The mirrored model with a material of its own for each half, which use the same UVs; each has its rigidity, and
    what is in tile 1002 has the mesh's material."""
    scene = mirrored(folder, make=make, scheme=scheme)
    stage = Usd.Stage.Open(str(scene))
    for name in ("left", "right"):
        indices = Vt.IntArray.FromNumpy(FACES[name].astype(np.int32))
        subset = UsdShade.MaterialBindingAPI(stage.GetPrimAtPath(MESH)).CreateMaterialBindSubset(name, indices)
        scenes.bind(subset.GetPrim(), make(stage, f"/model/{name}"))
    stage.Save()
    studs = pixels(folder / "rigid.1001.png")
    # Others on the right: every second column of them.
    other = np.where((np.arange(SIZE) * 5 // SIZE % 2 == 0)[None, :, None], 0, studs).astype(np.uint8)
    for name, texels in (("left", studs), ("right", other), ("rest", studs)):
        image(folder / f"{name}.rigid.{TILE[name]}.png", texels)
    return scene


def arguments(scene: Path, out: Path, *more: object) -> list[object]:
    folder = scene.parent
    options = ("--form", "udim", "--measure", "--layer", out.parent / "over.usda", "--subsets", "--device", "cpu")
    options += ("--size", SIZE)
    return ["bake", scene, "--rigidity", folder / "<subset>.rigid.<UDIM>.png", "--out", out, *options, *more]


def solved(scene: Path, name: str, frame: int = 2, subdivide: int = 0) -> vrtm.Asset:
    """A subset alone in a frame, solved by the library without the command."""
    per_face = 16 if subdivide else 1
    faces = (FACES[name][:, None] * per_face + np.arange(per_face)).ravel()
    options = SceneOptions(subdivide=subdivide)
    return solved_alone(scene, frame, SIZE, f"{name}.rigid.<UDIM>.png", options, textured_faces=faces)


@pytest.fixture(scope="module")
def baked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("subsets")
    scene = two_materials(folder / "shot")
    run(*arguments(scene, folder / "maps"), "--report", folder / "report.json")
    return scene


def test_each_subset_has_maps_of_its_own(baked: Path) -> None:
    out = baked.parents[1] / "maps"
    assert set(files(out)) == {f"{name}.redirect.000{f}.{udim}.exr" for name, udim in TILE.items() for f in (1, 2)}
    for name, udim in TILE.items():
        (tile,) = solved(baked, name).tiles
        path = out / f"{name}.redirect.0002.{udim}.exr"
        assert np.array_equal(pixels(path), tile.fetch("redirection_udim", SIZE, channels=3))
        assert attributes(path)["vrtm:subset"] == name and "vrtm:layer" not in attributes(path)
    before = files(out)
    assert "0 files written, 6 up to date" in run(*arguments(baked, out)).stdout
    assert "0 files written, 4 up to date" in run(*arguments(baked, out), "--tiles", 1001).stdout
    (out / "right.redirect.0001.1001.exr").unlink()
    assert "1 file written, 5 up to date" in run(*arguments(baked, out)).stdout and files(out) == before


def test_subsets_do_not_freeze_one_another(baked: Path, tmp_path: Path) -> None:
    rows = json.loads((baked.parents[1] / "report.json").read_text())["frames"][1]["tiles"]
    assert [(row["subset"], row["udim"], row["layers"]) for row in rows] == [(*of, 1) for of in TILE.items()]
    for row in rows[:2]:
        strain = row["strain"]
        assert row["rigid"]["fixed"] == 0 and strain["before"]["rms"] > 0.1
        assert strain["after"]["rms"] < strain["before"]["rms"] / 3
    # Also without layers, since each is an asset of its own; as a whole, nothing moves there.
    run(*arguments(baked, tmp_path / "fixed", "--overlap", "fixed"))
    assert files(tmp_path / "fixed") == files(baked.parents[1] / "maps")
    ended = run(*sheet_arguments(baked, tmp_path / "whole", "--overlap", "fixed"))
    assert f"{MESH} tile 1001: 100% of its rigid texels are fixed" in ended.stderr
    ended = run(*arguments(baked, tmp_path / "dry", "--dry-run", "--verbose"))
    assert "  tile 1001 of right: grid" in ended.stdout and not (tmp_path / "dry").exists()
    ended = run(*arguments(baked, tmp_path / "told", "--max-strain", 0.001, "--frames", 2), expect=3)
    assert f"{MESH} tile 1001 of left: 0.0% of the rigid texels are fixed" in ended.stdout
    assert "tile 1001 of " in ended.stderr.splitlines()[-1]


def test_the_layer_binds_the_maps_of_each_subset(baked: Path) -> None:
    stage = composed(baked, baked.parents[1] / "over.usda")
    check_family(stage, "nonOverlapping")
    found = materials(stage)
    assert set(found) == {"", "left", "right"}
    for name, base in (("left", "left"), ("right", "right"), ("", "skin")):
        faces, material = found[name]
        part = name or "rest"
        assert np.array_equal(faces, FACES[part])
        assert material.GetPath() == f"/model/{base}_mirrored_{part}_redirected"
        assert looked_up(material) == f"./maps/{part}.redirect.0002.<UDIM>.exr"
    assert not stage.GetPrimAtPath(MESH).HasAttribute("primvars:vrtmLayer")


@pytest.mark.parametrize("subdivide", [0, 2])
def test_corner_uvs_are_those_of_each_subset(tmp_path: Path, subdivide: int) -> None:
    scene = two_materials(tmp_path / "shot", scenes.preview_material, "catmullClark" if subdivide else "none")
    given = arguments(scene, tmp_path / "maps", "--layer-mode", "primvar", "--subdivide", subdivide, "--frames", 2)
    run(*given)
    stage = composed(scene, tmp_path / "over.usda")
    primvar = UsdGeom.PrimvarsAPI(stage.GetPrimAtPath(MESH)).GetPrimvar("st_redirected")
    found = np.array(primvar.Get(2)).reshape(3, HALF * 4, 2)
    with Scene(scene, SceneOptions(subdivide=subdivide)) as opened:
        cage = opened.shapes[0].cage_corners
    for index, name in enumerate(FACES):
        expected = solved(scene, name, 2, subdivide).corner_uvs()
        expected = expected if cage is None else expected[cage]
        assert np.array_equal(found[index], expected.reshape(3, HALF * 4, 2)[index])
    assert not np.allclose(found[0], found[1, ::-1], atol=1e-3)
    assert "0 files written, 4 up to date" in run(*given).stdout


def test_copies_of_textures_are_those_of_each_subset(tmp_path: Path) -> None:
    scene = two_materials(tmp_path / "shot", scenes.preview_material)
    folder = scene.parent
    for name in ("left", "right"):
        image(folder / f"{name}.colour.1001.png", pixels(folder / "colour.1001.png"))
        stage = Usd.Stage.Open(str(scene))
        node = UsdShade.Shader(stage.GetPrimAtPath(f"/model/{name}/colour"))
        node.GetInput("file").Set(f"{name}.colour.<UDIM>.png")
        stage.Save()
    run(*arguments(scene, tmp_path / "maps", "--texture", folder / "<subset>.colour.<UDIM>.png", "--overlap", "fixed"))
    copies = {name for name in files(tmp_path / "maps") if ".colour." in name}
    assert copies == {f"{name}.colour.000{frame}.1001.png" for name in ("left", "right") for frame in (1, 2)}
    stage = composed(scene, tmp_path / "over.usda")
    found = materials(stage)
    for name in ("left", "right"):
        assert looked_up(found[name][1]) == f"./maps/{name}.colour.0002.<UDIM>.png"
    # Nothing was warped for the faces in no subset: they keep what they have.
    assert found[""][1].GetPath() == "/model/skin"


def test_a_subset_may_have_layers(tmp_path: Path) -> None:
    scene = mirrored(tmp_path / "shot")
    stage = Usd.Stage.Open(str(scene))
    indices = Vt.IntArray.FromNumpy(np.arange(2 * HALF, dtype=np.int32))
    subset = UsdShade.MaterialBindingAPI(stage.GetPrimAtPath(MESH)).CreateMaterialBindSubset("both", indices)
    scenes.bind(subset.GetPrim(), scenes.materialx_material(stage, "/model/both"))
    stage.Save()
    given = arguments(scene, tmp_path / "maps", "--rigidity", scene.parent / "rigid.<UDIM>.png", "--frames", 2)
    run(*given)
    expected = {"both.redirect.0002.1001.exr", "both.redirect_layer1.0002.1001.exr", "rest.redirect.0002.1002.exr"}
    assert set(files(tmp_path / "maps")) == expected
    stage = composed(scene, tmp_path / "over.usda")
    check_family(stage, "nonOverlapping")
    found = materials(stage)
    for name, part, faces, mark in (
        ("both", "both", FACES["left"], ""),
        ("both_vrtm_layer1", "both", FACES["right"], "_layer1"),
        ("", "rest", FACES["rest"], ""),
    ):
        assert np.array_equal(found[name][0], faces)
        assert looked_up(found[name][1]) == f"./maps/{part}.redirect{mark}.0002.<UDIM>.exr"
    layers = UsdGeom.PrimvarsAPI(stage.GetPrimAtPath(MESH)).GetPrimvar("vrtmLayer").Get()
    assert np.array_equal(layers, np.repeat([0, 1, 0], HALF))


def test_wrong_uses_are_refused(baked: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    for more, told in (
        (("--name", "<kind>.<frame>.<UDIM>.exr"), "3 values of <subset> are written"),
        (("--rigidity", baked.parent / "none.<UDIM>.png"), "no such file"),
    ):
        assert told in run(*arguments(baked, out, *more), expect=2).stderr, told
    given = arguments(baked, out)
    given.remove("--subsets")
    assert "<subset> needs --subsets" in run(*given, expect=2).stderr
    named = sheet_arguments(baked, out, "--name", "<subset>.<kind>.<frame>.<UDIM>.exr")
    assert "<subset> needs --subsets" in run(*named, expect=2).stderr
    plain = sheet(tmp_path / "plain", frames=1)
    assert "has subsets that materials can be" in run(*sheet_arguments(plain, out, "--subsets"), expect=2).stderr
    assert not out.exists()
    # One of the subsets may have no map.
    (baked.parent / "rest.rigid.1002.png").rename(tmp_path / "kept.png")
    ended = run(*arguments(baked, out, "--frames", 1))
    (tmp_path / "kept.png").rename(baked.parent / "rest.rigid.1002.png")
    assert f"{MESH} subset rest, tile 1002: no map of --rigidity: nothing keeps its shape there" in ended.stderr


def test_subsets_that_no_mesh_can_have_are_told(tmp_path: Path) -> None:
    stage = scenes.stage(tmp_path / "a.usda")
    prim = scenes.mesh(stage, "/cloth")
    api = UsdShade.MaterialBindingAPI.Apply(prim.GetPrim())
    for name, faces in {"skin": [0], "metal": [1], "none": []}.items():
        api.CreateMaterialBindSubset(name, faces)
    stage.Save()
    assert Scene(tmp_path / "a.usda").warnings == []
    UsdGeom.Subset.Get(stage, "/cloth/metal").GetIndicesAttr().Set([1, 0, -1, 2])
    points = api.CreateMaterialBindSubset("points", [0, 1], UsdGeom.Tokens.face)
    points.GetElementTypeAttr().Set(UsdGeom.Tokens.point)
    stage.Save()
    scene = Scene(tmp_path / "a.usda")
    assert scene.warnings == [
        "/cloth subset metal: indices[2] is -1, but the mesh has 2 faces: 2 are no face",
        "/cloth subset metal: face 0 is in the subset skin, too (1 is in several): --subsets bakes it with the first",
        "/cloth subset points: it is of elements of the type point, not face: it is not read",
    ]
    found = {name: faces.tolist() for name, faces in scene.shapes[0].subsets.items()}
    assert found == {"skin": [0], "metal": [0, 1], "none": []}
