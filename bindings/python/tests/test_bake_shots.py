"""Motion of all kinds, and settings: what reaches the library, and what comes of it."""

import json
from pathlib import Path

import numpy as np
import pytest
from pxr import Gf, Usd, UsdGeom

import scenes
import vrtm
from bake_scenes import MESH, attributes, files, opened, pixels, run, sheet, sheet_arguments, solved_alone, written
from vrtm.bake import work
from vrtm.bake.scene import Scene, SceneOptions


def maps(folder: Path) -> dict[str, np.ndarray]:
    return {path.name: pixels(path) for path in sorted(folder.glob("*.exr"))}


def test_transforms_count_in_the_world(tmp_path: Path) -> None:
    # One sheet whose points are stretched, and one at rest below a transform that does the same, far away.
    scales = {1: (1.0, 1.0, 1.0), 2: (1.5, 1.0, 1.0), 3: (0.5, 2.0, 1.0)}
    by_points, by_transform = (sheet(tmp_path / kind, frames=3) for kind in ("points", "transform"))
    stage = Usd.Stage.Open(str(by_points))
    points = stage.GetPrimAtPath(MESH).GetAttribute("points")
    for frame, by in scales.items():
        points.Set(np.array(points.Get()) * np.float32(by), frame)
    stage.Save()
    stage = Usd.Stage.Open(str(by_transform))
    for frame in scales:
        stage.GetPrimAtPath(MESH).GetAttribute("points").ClearAtTime(frame)
    xform = UsdGeom.Xformable(stage.GetPrimAtPath("/model"))
    xform.AddTranslateOp().Set(Gf.Vec3d(1e7, 0, 0))
    xform.AddRotateZOp().Set(90.0)
    scale = xform.AddScaleOp()
    for frame, by in scales.items():
        scale.Set(Gf.Vec3f(*by), frame)
    stage.Save()
    run(*sheet_arguments(by_points, tmp_path / "expected"))
    told = run(*sheet_arguments(by_transform, tmp_path / "world", "--world"))
    assert "scale it" not in told.stderr
    expected, found = maps(tmp_path / "expected"), maps(tmp_path / "world")
    assert len(expected) == 6 and list(expected) == list(found)
    for name, image in expected.items():
        assert np.abs(image - found[name]).max() < 2e-5, name
    moved = expected["redirect.0003.1001.exr"] - expected["redirect.0001.1001.exr"]
    assert np.abs(moved).max() > 0.01
    # Without, nothing deforms, and a warning tells of the scale.
    ended = run(*sheet_arguments(by_transform, tmp_path / "local", "--meshes", "sheet"))
    (warning,) = [line for line in ended.stderr.splitlines() if "scale it" in line]
    assert warning.startswith(f"vrtm: warning: {MESH}: ") and "4 times as much" in warning and "--world" in warning
    assert "frame 3, against frame 1" in warning
    assert all(np.array_equal(a, b) for a, b in zip(*[iter(maps(tmp_path / "local").values())] * 2))


def test_the_world_of_a_skinned_mesh_and_of_instances(tmp_path: Path) -> None:
    stage = scenes.arm(tmp_path / "arm.usda", 4)
    op = UsdGeom.Xformable(stage.GetPrimAtPath("/arm")).AddScaleOp()
    op.Set(Gf.Vec3f(1, 1, 1), 1)
    op.Set(Gf.Vec3f(1, 3, 1), 4)
    stage.Save()
    with Scene(tmp_path / "arm.usda") as local, Scene(tmp_path / "arm.usda", SceneOptions(world=True)) as world:
        assert any("3 times as much" in warning for warning in local.warnings) and not world.warnings
        for frame in (1, 4):
            by = (1, 1 if frame == 1 else 3, 1)
            assert np.allclose(world.positions("skin", frame), local.positions("skin", frame) * by)
        assert np.allclose(world.shapes[0].rest, local.shapes[0].rest)
    # Two instances that are scaled in different ways are two shapes then.
    for name, by in (("a", 1.0), ("b", 2.0), ("c", 1.0)):
        prim = stage.DefinePrim(f"/crowd/{name}", "Xform")
        prim.GetReferences().AddInternalReference("/arm")
        prim.SetInstanceable(True)
        UsdGeom.Xformable(prim).ClearXformOpOrder()
        UsdGeom.Xformable(prim).AddScaleOp(UsdGeom.XformOp.PrecisionFloat, "own").Set(Gf.Vec3f(by, 1, 1))
    stage.Save()
    for world, count in ((False, 1), (True, 2)):
        with Scene(tmp_path / "arm.usda", SceneOptions(world=world, meshes=("/crowd",))) as scene:
            assert len(scene.shapes) == count


def test_parts_of_frames(scene: Path, tmp_path: Path) -> None:
    run(*sheet_arguments(scene, tmp_path / "out", "--frames", "1-2x0.5,4.25,9.5", "--tiles", 1001))
    frames = {"0001": 1, "0001.5": 1.5, "0002": 2, "0004.25": 4.25}
    assert sorted(files(tmp_path / "out")) == [f"redirect.{name}.1001.exr" for name in sorted(frames)]
    for name, frame in frames.items():
        path = tmp_path / "out" / f"redirect.{name}.1001.exr"
        expected = solved_alone(scene, frame).tile(1001).fetch("redirection", (64, 64), channels=3)
        assert np.array_equal(pixels(path), expected)
        assert attributes(path)["vrtm:frame"] == (frame if isinstance(frame, int) else str(frame))
    assert written(run(*sheet_arguments(scene, tmp_path / "out", "--frames", "1-2x0.5", "--tiles", 1001))) == (0, 3)


def test_frames_that_start_from_one_another(scene: Path, tmp_path: Path) -> None:
    arguments = sheet_arguments(scene, tmp_path / "out", "--warm", "--temporal-weight", 0.2, "--jobs", 2)
    assert written(run(*arguments)) == (10, 0)
    asset = solved_alone(scene, 1, solve=False)
    with Scene(scene) as file:
        for frame in file.frames:
            asset.solve(file.positions(file.shapes[0], frame), warm=True, temporal_weight=0.2)
            for tile in asset.tiles:
                found = pixels(tmp_path / "out" / f"redirect.{frame:04d}.{tile.udim}.exr")
                assert np.array_equal(found, tile.fetch("redirection", (64, 64), channels=3))
    before = files(tmp_path / "out")
    assert written(run(*arguments)) == (0, 10)
    # One in the middle is made anew from all before it; the others are up to date.
    (tmp_path / "out" / "redirect.0003.1002.exr").unlink()
    assert written(run(*arguments)) == (1, 9) and files(tmp_path / "out") == before
    # Frames that begin elsewhere are others.
    assert written(run(*arguments, "--frames", "3-4")) == (4, 0)
    assert written(run(*sheet_arguments(scene, tmp_path / "out", "--frames", "1"))) == (2, 0)


def test_settings_of_tiles_reach_the_library(scene: Path, tmp_path: Path) -> None:
    given = {"smoothness": 0.1, "orientation": 0.5, "room": 0.6, "room_threshold": 0.2, "smoothness_floor": 0.001}
    given |= {"orientation_density": 0.3, "harm": 0}
    options = [word for name, value in given.items() for word in (f"--{name.replace('_', '-')}", value)]
    arguments = sheet_arguments(scene, tmp_path / "out", "--frames", 3, "--tiles", 1001)
    run(*arguments, *options, "--overlap", "first")
    given["overlap"] = "first_face"
    expected = solved_alone(scene, 3, settings=given).tile(1001).fetch("redirection", (64, 64), channels=3)
    found = pixels(tmp_path / "out" / "redirect.0003.1001.exr")
    assert np.array_equal(found, expected)
    assert written(run(*arguments)) == (1, 0)
    assert np.abs(pixels(tmp_path / "out" / "redirect.0003.1001.exr") - found).max() > 1e-3
    ended = run(*arguments, "--room-threshold", 2, expect=2)
    assert "room_threshold" in ended.stderr and len(ended.stderr.splitlines()) == 1


def off(tile: vrtm.Tile, width: int) -> float:
    """By how many texels of a texture of 1024 one percent of a map is off."""
    return 1024 * tile.inspect_map("redirection", (width, width)).error_p99


def test_maps_choose_their_size(scene: Path, tmp_path: Path) -> None:
    report = tmp_path / "report.json"
    sizes = {}
    for error in (0.5, 16):
        options = ("--map-size", "auto", "--max-error", error, "--texture-size", 1024, "--report", report)
        arguments = sheet_arguments(scene, tmp_path / f"{error}", "--frames", 5, "--jacobian", *options)
        run(*arguments, expect=None)
        made = solved_alone(scene, 5)
        for tile in json.loads(report.read_text())["frames"][0]["tiles"]:
            size = tuple(tile["map"]["size"])
            sizes[error, tile["udim"]] = size
            for kind in ("redirect", "jacobian"):
                found = pixels(tmp_path / f"{error}" / f"{kind}.0005.{tile['udim']}.exr")
                assert found.shape[:2] == size[::-1]

            own = off(made.tile(tile["udim"]), size[0])
            assert tile["map"]["error_texels"]["p99"] == pytest.approx(own)
            assert own <= error or size[0] == 128
            # The next smaller one would not have done.
            assert size[0] == 16 or off(made.tile(tile["udim"]), size[0] // 2) > min(error, own)
        assert written(run(*arguments, expect=None)) == (0, 4)
    assert sizes[16, 1001] < sizes[0.5, 1001]


def test_many_tiles_need_the_memory_of_one_solver(scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    held = []
    for most in (work._MOST_BYTES, 0):
        monkeypatch.setattr(work, "_MOST_BYTES", most)
        rigidity, out = str(scene.parent / "rigid.<UDIM>.png"), str(tmp_path / f"{most}")
        with opened(scene, rigidity=rigidity, out=out) as bake:
            expected = bake.bytes
            for frame in (1, 2):
                bake.bake("sheet", frame, lambda: None)
            held.append(bake.device.info.bytes_held)
            assert held[-1] < expected
    assert held[1] < 0.6 * held[0]
    first, second = (files(tmp_path / name) for name in sorted(path.name for path in tmp_path.iterdir()))
    assert len(first) == 4 and first == second
