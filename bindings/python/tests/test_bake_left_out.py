"""The list of what is not baked: on the screen, in the log and in the report, and what --strict makes of it."""

import json
import math
import shutil
from pathlib import Path

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdGeom

from bake_scenes import MESH, files, image, pixels, sheet, sheet_arguments, with_copies
from conftest import grid, refused
from vrtm import cli
from vrtm.bake import left_out
from vrtm.bake.left_out import LeftOut
from vrtm.bake.scene import Scene, SceneError, SceneOptions


def test_entries_that_say_the_same_are_told_together() -> None:
    entries = [
        LeftOut("has no UVs", "/a"),
        LeftOut("cannot be read", "/a", frames=(3,)),
        LeftOut("has no UVs", "/b"),
        LeftOut("cannot be read", "/a", frames=(2,)),
        LeftOut("not in --frames", frames=(7, 8, 9), meant=True),
        LeftOut("no map", "/a", frames=(1,), tiles=(1002, 1001)),
    ]
    told = [
        "/a and another mesh: has no UVs",
        "/a, frames 2-3: cannot be read",
        "frames 7-9: not in --frames",
        "/a, tiles 1001-1002, frame 1: no map",
    ]
    assert left_out.lines(entries) == told
    assert left_out.listed(entries) == ["not baked:", *(f"  {line}" for line in told)]
    assert left_out.listed([]) == []
    # What holds for all frames is not told of one of them again.
    assert left_out.lines([LeftOut("x", "/a"), LeftOut("x", "/a", frames=(1,))]) == ["/a: x"]
    assert len(left_out.listed(LeftOut(f"reason {number}") for number in range(99))) == 52


def test_all_that_is_not_baked_is_in_one_list(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    scene = sheet(tmp_path / "shot", frames=3, cells=4)
    stage = with_copies(scene, "bald", "hidden", "other", "few", "beyond", "nan")
    for name, uvs in (("few", [(0, 0)]), ("beyond", [(-1, -1)] * 50), ("nan", [(math.nan, 0)] * 50)):
        stage.GetPrimAtPath(f"/model/{name}").GetAttribute("primvars:st").Set(uvs)
    stage.GetPrimAtPath("/model/bald").RemoveProperty("primvars:st")
    UsdGeom.Imageable(stage.GetPrimAtPath("/model/hidden")).MakeInvisible()
    stage.Save()
    (scene.parent / "rigid.1002.png").unlink()
    out, report, log = tmp_path / "out", tmp_path / "report.json", tmp_path / "bake.log"
    options = ["--report", report, "--log", log, "--jobs", 1, "--exclude", "oth*"]
    arguments = list(map(str, sheet_arguments(scene, out, *options, "--frames", "2,3,8")))
    assert cli.main(arguments) == 0
    said = capfd.readouterr()
    told = [
        "/model/bald: has no UVs",
        "/model/hidden: is invisible in all frames",
        "/model/other: named by --exclude",
        "/model/few: cannot be read: primvars:st has 1 values of interpolation vertex, not 50",
        "all but 2 of 3 frames: not in --frames",
        "frame 8: the scene has 1-3",
        "/model/sheet, tile 1002: no map of --rigidity: nothing keeps its shape there",
        "/model/beyond: cannot be baked: none of its UVs lies in a UDIM tile: u from -1 to -1; v from -1 to -1; "
        "tiles have numbers where u is 0 to 10 and v is 0 to 900",
        "/model/nan: cannot be baked: vrtm_asset_create: desc.uvs[0]: component 0 is NaN",
    ]
    assert said.out.split("not baked:\n")[1].splitlines()[: len(told)] == [f"  {line}" for line in told]
    assert all(f"info:   {line}\n" in log.read_text() for line in told)
    wrong = [told[0], told[3], *told[5:]]
    (of_library, *warnings) = [line for line in said.err.splitlines() if "warning" in line]
    assert "/model/beyond: mesh: 32 faces" in of_library and warnings == [f"vrtm: warning: {line}" for line in wrong]
    rows = json.loads(report.read_text())["not_baked"]
    assert [row["meant"] for row in rows] == [False, True, True, False, True, *[False] * 4]
    where = {"mesh": None, "frames": [8], "tiles": [], "layers": []}
    assert rows[5] == where | {"why": "the scene has 1-3", "meant": False}
    assert (rows[6]["mesh"], rows[6]["tiles"]) == (MESH, [1002])
    # --strict: nothing is baked, and the report says why.
    assert cli.main([*arguments, "--strict"]) == 2
    assert f"vrtm: --strict: {wrong[0]} (and 5 more, named above)" in capfd.readouterr().err
    written = json.loads(report.read_text())
    assert (written["exit_code"], written["written"], len(written["not_baked"])) == (2, 0, 9)
    shutil.rmtree(out)
    assert cli.main([*arguments, "--strict"]) == 2 and not out.exists()
    capfd.readouterr()
    # What is meant is no error.
    asked = ["--meshes", "sheet", "--frames", "2", "--tiles", "1001", "--strict"]
    assert cli.main([*map(str, sheet_arguments(scene, out, *options)), *asked]) == 0
    assert "  /model/sheet, tile 1002: not in --tiles\n" in capfd.readouterr().out


def test_what_usd_says_is_told_once_and_in_the_list(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    scene = sheet(tmp_path / "shot", frames=1, cells=4)
    stage = Usd.Stage.Open(str(scene))
    stage.GetRootLayer().subLayerPaths.append("./gone.usda")
    stage.DefinePrim("/model/hair").GetReferences().AddReference("./hair.usda")
    stage.DefinePrim("/model/cloth").GetPayloads().AddPayload("./cloth.abc")
    (scene.parent / "cloth.abc").write_bytes(b"Ogawa")
    stage.DefinePrim("/model/clipped").SetMetadata(
        "clips", {"default": {"primPath": "/a", "assetPaths": Sdf.AssetPathArray(["./clip.usda"])}}
    )
    stage.Save()
    del stage
    capfd.readouterr()
    report = tmp_path / "report.json"
    arguments = sheet_arguments(scene, tmp_path / "out", "--report", report, "--jobs", 1)
    arguments += ["--layer", tmp_path / "over.usda", "--layer-mode", "primvar"]
    assert cli.main(list(map(str, arguments))) == 0
    said = capfd.readouterr()
    expected = {
        "/model/hair": "USD: Could not open asset @",
        None: "USD: Could not load sublayer @",
        str(scene): "what it takes from ./cloth.abc is missing: this build of USD (",
    }
    rows = [row for row in json.loads(report.read_text())["not_baked"] if not row["meant"]]
    assert {row["mesh"] for row in rows} == set(expected) and len(rows) == 3
    for row in rows:
        assert row["why"].startswith(expected[row["mesh"]]) and " stage " not in row["why"]
        assert said.out.count(row["why"]) == 1 and said.err.count(row["why"]) == 1
    # Nothing comes from USD itself.
    assert all(line.startswith("vrtm: ") for line in said.err.splitlines()), said.err
    # A stage in which nothing is says what it lacks.
    empty = Usd.Stage.CreateNew(str(tmp_path / "empty.usda"))
    empty.DefinePrim("/hair").GetReferences().AddReference("./hair.usda")
    empty.Save()
    lacks = r"no mesh to bake \(the scene has none\); /hair: USD: Could not open asset @"
    refused(SceneError, lacks, Scene, tmp_path / "empty.usda")


def test_surfaces_that_are_not_read_are_told(tmp_path: Path) -> None:
    path = sheet(tmp_path / "shot", frames=1, cells=4)
    stage = Usd.Stage.Open(str(path))
    UsdGeom.NurbsPatch.Define(stage, "/model/lid")
    UsdGeom.NurbsPatch.Define(stage, "/model/off").MakeInvisible()
    stage.Save()
    (lid, off) = Scene(path).left_out
    assert (lid.mesh, lid.why, lid.meant) == ("/model/lid", "is a NurbsPatch, which is not read", False)
    assert off.meant and not Scene(path, SceneOptions(meshes=("sheet",))).left_out


def _poses(folder: Path) -> list[str]:
    """A sheet in five poses, of which 2 has NaN and 4 other faces; the arguments that bake it."""
    points, faces = grid(4)
    uvs = "".join(f"vt {u} {v}\n" for u, v, _ in points)
    corners = "".join("f " + " ".join(f"{c + 1}/{c + 1}" for c in face) + "\n" for face in faces)
    for frame in range(6):
        places = "".join(f"v {x * (1 + 0.2 * frame * x)} {y} 0\n" for x, y, _ in points)
        places = places.replace("v 0.0 0.5 0", "v nan 0.5 0") if frame == 2 else places
        (folder / f"pose.{frame}.obj").write_text(places + uvs + (corners if frame != 4 else corners[10:]))
    image(folder / "rigid.png", np.tile(np.uint8([[0, 255], [255, 0]]), (8, 8))[..., None])
    given = ["bake", "pose.0.obj", "--rigidity", "rigid.png", "--out", "out", "--device", "cpu", "--jobs", "1"]
    return [*given, "--poses", "pose.#.obj", "--report", "report.json"]


@pytest.mark.parametrize("more", [[], ["--warm"]])
def test_a_pose_that_cannot_be_used_is_left_out(tmp_path: Path, monkeypatch, capfd, more: list[str]) -> None:
    monkeypatch.chdir(tmp_path)
    given = [*_poses(tmp_path), *more]
    names = {f"redirect.{frame:04}.1001.exr" for frame in (1, 3, 5)}
    assert cli.main([*given, "--frames", "1-5"]) == 0
    said = capfd.readouterr()
    assert set(files(tmp_path / "out")) == names
    (nan, faces) = (row for row in json.loads((tmp_path / "report.json").read_text())["not_baked"] if not row["meant"])
    assert (nan["mesh"], nan["frames"], faces["frames"]) == ("pose.0.obj", [2], [4])
    assert "positions[10]: component 0 is NaN" in nan["why"] and "pose.4.obj" in faces["why"]
    assert "frame 2: not baked" in said.out and said.err.count("pose.0.obj, frame 2: ") == 1
    # A limit is not kept where nothing was measured.
    assert cli.main([*given, "--frames", "1-5", "--max-strain", "9", "--out", "limited"]) == 3
    unknown = "--max-strain could not be checked in 2 places: pose_0, frame 2: its pose cannot be taken"
    assert unknown in capfd.readouterr().err
    # What is there stays up to date; --strict makes an error of the rest, and so does a bake of nothing else.
    assert cli.main([*given, "--frames", "1-5", "--strict"]) == 2
    assert "0 files written, 3 up to date" in capfd.readouterr().out or more
    assert cli.main([*given, "--frames", "2,4"]) == 2
    assert "pose.0.obj, frame 2: its pose cannot be taken" in capfd.readouterr().err
    # The frames after it are as without it.
    if not more:
        assert cli.main([*given, "--frames", "3", "--out", "alone"]) == 0
        name = "redirect.0003.1001.exr"
        assert np.array_equal(pixels(tmp_path / "out" / name), pixels(tmp_path / "alone" / name))
