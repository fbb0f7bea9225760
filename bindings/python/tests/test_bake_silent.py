"""Warnings of a bake that changes nothing, or less than it seems."""

import json
from pathlib import Path

import numpy as np
import pytest
from pxr import Usd, UsdShade

import scenes
from bake_scenes import flat, image, run, sheet, sheet_arguments, with_copies
from conftest import grid
from scenes import bind, preview_material

STACKED, FREE = "/model/stacked", "/model/free"


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two meshes that are stretched, of two quadrilaterals each: one's lie over the same UVs, the other's side by side.
    Everything on them is rigid."""
    folder = tmp_path_factory.mktemp("stacked")
    stage = scenes.stage(folder / "shot.usda", 1, 4)
    corners = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)])
    rest = np.concatenate([corners, np.add(corners, (2, 0, 0))])
    for path, apart in ((STACKED, 0.0), (FREE, 0.5)):
        poses = {frame: rest * (1 + 0.1 * frame * rest[:, :1] * [0, 1, 0]) for frame in range(1, 5)}
        uvs = [(0.1 + 0.35 * x + apart * face, 0.1 + 0.8 * y) for face in range(2) for x, y, _ in corners]
        scenes.mesh(stage, path, rest, uvs, faces=range(8), poses=poses, pref=True)
    stage.Save()
    image(folder / "rigid.png", np.full((64, 64, 1), 255, np.uint8))
    return folder / "shot.usda"


def bake(scene: Path, out: Path, *more: object) -> list[object]:
    rigidity = scene.parent / "rigid.png"
    return ["bake", scene, "--rigidity", rigidity, "--overlap", "fixed", "--device", "cpu", "--out", out, *more]


def test_stacked_uvs_are_told_and_not_within_a_tolerance(scene: Path, tmp_path: Path) -> None:
    report = tmp_path / "report.json"
    for state in ("written", "skipped"):
        options = ("--jobs", 2, "--max-strain", 0.9, "--report", report)
        ended = run(*bake(scene, tmp_path / "out", *options), expect=3)
        told = [line for line in ended.stderr.splitlines() if line.startswith("vrtm: warning: ")]
        # Once per mesh and tile, whatever the number of processes and frames.
        fixed = [line for line in told if "of its rigid texels are fixed" in line]
        assert len(fixed) == 1 and f"{STACKED} tile 1001: 100% of" in fixed[0]
        if state == "written":
            overlapped = [line for line in told if "overlapped" in line]
            assert len(overlapped) == 1 and overlapped[0].startswith(f"vrtm: warning: {STACKED}: tile 1001: 100.00 %")
            assert len([line for line in told if "nothing that may move" in line and STACKED in line]) == 1
        assert f"{STACKED} tile 1001: 100.0% of the rigid texels are fixed, 100.0% overlapped" in ended.stdout
        assert "--max-strain cannot be met in 4 of 8: stacked, frame 1, tile 1001" in ended.stderr
        document = json.loads(report.read_text())
        assert document["exit_code"] == 3
        assert [line.removeprefix("vrtm: warning: ") for line in told] == document["warnings"]
        for frame in document["frames"]:
            (tile,) = frame["tiles"]
            strain = tile["strain"]
            assert tile["state"] == state and strain["before"]["rms"] > 0.02 * frame["frame"]
            if frame["mesh"] == "stacked":
                assert (tile["overlap"], tile["fixed"], tile["movable"]) == (1.0, 1.0, 0.0)
                assert strain["movable"]["segments"] == 0 and strain["segments"] > 500
                assert strain["before"] == strain["after"]
            else:
                assert (tile["overlap"], strain["movable"]["segments"] > 500) == (0.0, True)
                assert tile["fixed"] < 0.5 and 0.2 < tile["movable"] < 0.8
                assert strain["segments"] > strain["movable"]["segments"]
                assert strain["movable"]["after"]["rms"] <= strain["after"]["rms"] < strain["before"]["rms"]


def test_a_pose_in_another_unit_ends_the_bake(tmp_path: Path) -> None:
    scene = sheet(tmp_path, frames=6, cells=4)
    stage = Usd.Stage.Open(str(scene))
    points = stage.GetPrimAtPath("/model/sheet").GetAttribute("points")
    for frame in range(2, 7):
        points.Set([p * 100 for p in points.Get(frame)], frame)
    stage.Save()
    arguments = sheet_arguments(scene, tmp_path / "out", "--jobs", 2)
    last = run(*arguments, expect=2).stderr.splitlines()[-1]
    assert "/model/sheet, frame " in last and "times as long as at rest (median; the rest is from Pref)" in last
    assert "--allow-units" in last and not (tmp_path / "out" / "redirect.0002.1001.exr").exists()
    # Else each worker tells, of a few frames.
    ended = run(*arguments, "--allow-units", "--report", tmp_path / "r.json", "--overwrite")
    told = [line for line in ended.stderr.splitlines() if "other units" in line]
    assert len(told) == 3 and all(line.startswith("vrtm: warning: /model/sheet, frame ") for line in told)
    assert ended.stderr.count("/model/sheet: the same of further frames") == 1
    frames = json.loads((tmp_path / "r.json").read_text())["frames"]
    warned = [frame["frame"] for frame in frames if any("other units" in w for w in frame["warnings"])]
    assert warned == [2, 3, 4, 5, 6]


def test_a_pose_that_tears_in_many_frames_is_told_once(tmp_path: Path) -> None:
    # Two strips whose sides at x = 1 are welded by position. Each frame pulls one vertex more apart.
    strip, faces = grid(1, 8)
    rest = np.concatenate([strip, np.add(strip, (1, 0, 0))])
    right = np.flatnonzero((rest[:, 0] == 1) & (np.arange(len(rest)) >= len(strip)))
    poses = {frame: rest * [1, 1.1, 1] for frame in range(1, 5)}
    for frame, pose in poses.items():
        pose[right[: frame + 1], 0] += 0.1
    stage = scenes.stage(tmp_path / "tear.usda", 1, 4)
    faces, uvs = np.concatenate([faces, faces + len(strip)]), 0.1 + rest[:, :2] * [0.4, 0.8]
    scenes.mesh(stage, "/model/strips", rest, uvs, faces=faces, poses=poses, pref=True)
    stage.Save()
    image(tmp_path / "rigid.png", np.full((32, 32, 1), 255, np.uint8))
    arguments = bake(tmp_path / "tear.usda", tmp_path / "out", "--weld", "position", "--jobs", 2)
    told = [line for line in run(*arguments).stderr.splitlines() if "welded edges" in line]
    assert len(told) == 1 and told[0].startswith("vrtm: warning: /model/strips: tile 1001: the pose tears"), told


def test_missing_rigidity_is_told_by_the_names_of_maps_and_primvars(tmp_path: Path) -> None:
    scene = sheet(tmp_path / "maps", frames=1, cells=4)
    arguments = ["bake", scene, "--size", 32, "--jobs", 1, "--device", "cpu", "--out", tmp_path / "out", "--rigidity"]
    # By the name of the mesh; one map is black.
    (scene.parent / "rigid.1001.png").rename(scene.parent / "sheet.1001.png")
    flat(scene.parent / "sheet.1002.png", 0)
    told = run(*arguments, scene.parent / "<mesh>.<UDIM>.png", "--strict").stderr
    assert "sheet.1002.png is black all over" in told and "no map of" not in told
    told = run(*arguments, scene.parent / "none.<mesh>.<UDIM>.png").stderr
    assert "/model/sheet, tiles 1001-1002: no map of --rigidity" in told
    # By values per vertex, which one of two meshes lacks.
    stage = with_copies(scene, "other")
    scenes.primvar(stage.GetPrimAtPath("/model/other"), "rigid", scenes.TYPES.FloatArray, [1.0] * 50, "vertex")
    stage.Save()
    by_vertex = [*arguments[:-1], "--rigidity-primvar", "rigid"]
    assert "/model/sheet, tiles 1001-1002: no values of --rigidity-primvar" in run(*by_vertex).stderr
    assert "/model/sheet" in run(*by_vertex, "--strict", expect=2).stderr


def test_a_layer_that_redirects_nothing_says_what_to_give(tmp_path: Path) -> None:
    scene = sheet(tmp_path / "shot", frames=1, cells=4)
    arguments = sheet_arguments(scene, tmp_path / "out", "--layer", tmp_path / "over.usda")

    def refused() -> None:
        for more in ((), ("--only-layer",), ("--task", "1/1"), ("--dry-run",)):
            ended = run(*arguments, *more, expect=2)
            last = ended.stderr.splitlines()[-1]
            assert "over.usda: it redirects nothing" in last and "--texture" in last and "--layer-mode primvar" in last
            assert ("files: 2 below " in ended.stdout) == ("--dry-run" in more), "nothing is baked for it"
            assert not (tmp_path / "over.usda").exists() and not (tmp_path / "out").exists()

    # No material; then one that can take warped copies alone, of which there are none.
    refused()
    stage = Usd.Stage.Open(str(scene))
    bind(stage.GetPrimAtPath("/model/sheet"), preview_material(stage, "/model/material"))
    stage.Save()
    refused()
    run(*arguments, "--texture", scene.parent / "colour.<udim>.png")
    run(*arguments, "--layer-mode", "primvar")
    # A material that a stronger binding keeps from counting.
    stage = Usd.Stage.Open(str(scene))
    above = UsdShade.MaterialBindingAPI.Apply(stage.GetPrimAtPath("/model"))
    above.Bind(UsdShade.Material.Get(stage, "/model/material"), UsdShade.Tokens.strongerThanDescendants)
    stage.Save()
    arguments = [*arguments, "--texture", scene.parent / "colour.<UDIM>.png"]
    assert "a stronger binding keeps" in run(*arguments, expect=2).stderr
