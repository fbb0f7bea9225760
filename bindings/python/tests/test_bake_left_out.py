"""The list of what is not baked: on the screen, in the log and in the report, and what --strict makes of it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from pxr import Sdf, Usd, UsdGeom

from bake_scenes import MESH, sheet, sheet_arguments
from vrtm import cli
from vrtm.bake import left_out
from vrtm.bake.left_out import LeftOut


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
    stage = Usd.Stage.Open(str(scene))
    layer = stage.GetRootLayer()
    for name in ("bald", "hidden", "other"):
        Sdf.CopySpec(layer, MESH, layer, f"/model/{name}")
    stage.RemovePrim("/model/other")
    stage.GetPrimAtPath("/model/bald").RemoveProperty("primvars:st")
    UsdGeom.Imageable(stage.GetPrimAtPath("/model/hidden")).MakeInvisible()
    stage.Save()
    (scene.parent / "rigid.1002.png").unlink()
    out, report, log = tmp_path / "out", tmp_path / "report.json", tmp_path / "bake.log"
    options = ["--report", report, "--log", log, "--jobs", 1]
    arguments = list(map(str, sheet_arguments(scene, out, *options, "--frames", "2,3,8")))
    assert cli.main(arguments) == 0
    said = capfd.readouterr()
    told = [
        "/model/bald: has no UVs",
        "/model/hidden: is invisible in all frames",
        "frame 1: not in --frames",
        "frame 8: the scene has 1-3",
        "/model/sheet, tile 1002: no map of --rigidity: nothing keeps its shape there",
    ]
    assert said.out.split("not baked:\n")[1].splitlines()[: len(told)] == [f"  {line}" for line in told]
    assert all(f"info:   {line}\n" in log.read_text() for line in told)
    wrong = [told[0], *told[3:]]
    assert [line for line in said.err.splitlines() if "warning" in line] == [f"vrtm: warning: {line}" for line in wrong]
    rows = json.loads(report.read_text())["not_baked"]
    assert [row["meant"] for row in rows] == [False, True, True, False, False]
    where = {"mesh": None, "frames": [8], "tiles": [], "layers": []}
    assert rows[3] == where | {"why": "the scene has 1-3", "meant": False}
    assert (rows[4]["mesh"], rows[4]["tiles"]) == (MESH, [1002])
    # --strict: nothing is baked, and the report says why.
    assert cli.main([*arguments, "--force", "--strict"]) == 2
    assert f"vrtm: --strict: {wrong[0]} (and 2 more, named above)" in capfd.readouterr().err
    written = json.loads(report.read_text())
    assert (written["exit_code"], written["written"], len(written["not_baked"])) == (2, 0, 5)
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
    arguments = sheet_arguments(scene, tmp_path / "out", "--report", report, "--jobs", 1, "--tiles", 1001)
    arguments += ["--layer", tmp_path / "over.usda", "--layer-mode", "texture"]
    cli.main(list(map(str, arguments)))
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
