"""Frames among the times of a scene: time codes, rates, samples of motion blur."""

import math
from pathlib import Path

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdGeom

import scenes
from bake_scenes import opened
from conftest import refused
from shots import write_corner_uvs
from vrtm.bake import arguments, parsing
from vrtm.bake.layer.plan import LayerPlan
from vrtm.bake.layer.write import write_layer
from vrtm.bake.scene import Scene, SceneError, SceneOptions

FILE = SceneOptions(fps="file")


def animated(path: Path, times, codes: float | None = 24, fps: float | None = 24, ends=None) -> Usd.Stage:
    """A mesh with samples at time codes, the n-th of which moves it by n / 10."""
    stage = scenes.stage(path, *(ends or (times[0], times[-1])), fps=None)
    for name, value in (("timeCodesPerSecond", codes), ("framesPerSecond", fps)):
        if value:
            stage.SetMetadata(name, value)
    right = np.equal(scenes.POINTS, [2, 9, 9])
    scenes.mesh(stage, "/mesh", poses={time: scenes.POINTS + 0.1 * k * right for k, time in enumerate(times)})
    stage.Save()
    return stage


def place(scene: Scene, frame: float) -> float:
    return float(scene.positions("mesh", frame)[2, 0])


def around(frames, offsets) -> list[float]:
    return sorted(frame + offset for frame in frames for offset in offsets)


@pytest.mark.parametrize(
    ("times", "codes", "fps", "by_codes", "by_file"),
    [
        ([n / 24 for n in range(25)], 1, 24, (0, 1), range(25)),
        ([round(n / 24, 6) for n in range(25)], 1, 24, (0, 1), range(25)),
        (list(range(0, 50, 2)), 48, 24, range(49), range(25)),
        ([n / 25 for n in range(26)], 1, None, (0, 1), range(26)),
        ([1000 * n / 30 for n in range(31)], 1000, 30, range(1001), range(31)),
        (list(range(1001, 1011)), 24, 24, range(1001, 1011), range(1001, 1011)),
        (list(range(1, 11)), None, 30, range(1, 11), range(1, 11)),
        (list(range(1, 11)), 60, None, range(1, 11), range(1, 11)),
    ],
)
def test_frames_are_time_codes_or_counted_by_the_rate(tmp_path: Path, times, codes, fps, by_codes, by_file) -> None:
    animated(tmp_path / "a.usda", times, codes, fps)
    scene, own = Scene(tmp_path / "a.usda"), Scene(tmp_path / "a.usda", FILE)
    assert (scene.frames, own.frames) == (tuple(by_codes), tuple(by_file))
    # The n-th sample is the n-th frame, by the file's rate.
    for number, frame in enumerate(own.frames):
        assert place(own, frame) == pytest.approx(2 + 0.1 * number, abs=1e-4)
    assert not own.warnings and bool(scene.warnings) == (len(by_codes) != len(by_file))


def test_time_codes_that_are_no_frames_are_told(tmp_path: Path) -> None:
    for name, given, expected in (
        ("a", ([n / 24 for n in range(25)], 1, 24), "and 23 samples between them, such as 0.04167, are not baked: "),
        ("b", (range(0, 50, 2), 48, 24), "for frames: --fps file takes 2 time codes for each frame"),
        ("c", ([n / 25 for n in range(26)], 1, None), "24 of its 26 samples lie between frames, such as at 0.04, and"),
        ("d", ([0.8 * n for n in range(50)], 24, 24), "--fps 30 counts frames by them"),
    ):
        animated(tmp_path / f"{name}.usda", list(given[0]), *given[1:])
        (warning,) = Scene(tmp_path / f"{name}.usda").warnings
        assert expected in warning
    assert not Scene(tmp_path / "c.usda", SceneOptions(fps=25)).warnings
    # A rate that is asked for needs no warning.
    animated(tmp_path / "e.usda", range(1, 39), 60, 24)
    for fps in (24, "file"):
        scene = Scene(tmp_path / "e.usda", SceneOptions(fps=fps))
        assert not [warning for warning in scene.warnings if "between" in warning]
        told = "; /mesh: 31 of its 38 samples lie between frames, such as at 0.4, and are not baked"
        assert scene.rate == f"24 per second (timeCodesPerSecond 60){told}"
    with opened(tmp_path / "e.usda", SceneOptions(fps=24), frames=(1, 2)) as work:
        # Nor does it name the ends of the range, which are no frames.
        assert [entry.line() for entry in work.left_out] == ["all but 2 of 15 frames: not in --frames"]


@pytest.mark.parametrize("ends", [(1.0000000000000002, 5.999999999999999), (-1.9999999999999998, 3), (0.9999, 6.0001)])
def test_ends_that_are_off_by_rounding_are_whole(tmp_path: Path, ends) -> None:
    whole = tuple(range(round(ends[0]), round(ends[1]) + 1))
    stage = animated(tmp_path / "a.usda", [ends[0], *whole[1:-1], ends[1]], ends=ends)
    for name in ("", "startTimeCode", "endTimeCode"):
        # Without a range the first and the last sample are the ends.
        _ = name and stage.ClearMetadata(name)
        stage.Save()
        scene = Scene(tmp_path / "a.usda")
        assert scene.frames == whole and not scene.warnings and not scene.left_out


@pytest.mark.parametrize(
    "times",
    [
        around(range(1, 6), (-0.25, 0, 0.25)),
        around(range(1, 6), (-0.25, 0.25)),
        around(range(1, 6), (0, 0.5)),
        around(range(1, 6), (0, 0.2, 0.45)),
        around(range(1, 9, 2), (0,)),
        around((1, 10, 17.5, 33.25, 60), (0,)),
    ],
)
def test_samples_for_motion_blur_are_no_other_rate(tmp_path: Path, times) -> None:
    animated(tmp_path / "a.usda", times, ends=(1, 5))
    for options in (SceneOptions(), FILE):
        scene = Scene(tmp_path / "a.usda", options)
        assert not scene.warnings and scene.frames == (1, 2, 3, 4, 5)


def test_frames_without_samples_are_told(tmp_path: Path) -> None:
    animated(tmp_path / "anim.usda", list(range(1001, 1011)), 25, 25)
    shot = Usd.Stage.CreateNew(str(tmp_path / "shot.usda"))
    shot.SetStartTimeCode(1001)
    shot.SetEndTimeCode(1010)
    shot.DefinePrim("/char").GetReferences().AddReference("anim.usda", "/mesh")
    shot.Save()
    expected = "in frames 1001-1010 /char does not move: its samples lie at 960.96-969.6"
    assert Scene(tmp_path / "shot.usda").warnings == [expected]
    # Also where a skeleton moves it, and of one frame.
    arm = scenes.arm(tmp_path / "arm.usda")
    for first, last, expected in (
        (20, 30, ["in frames 20-30 /arm/skin does not move: its samples lie at 1-10"]),
        (-5, 1, ["in frames -5-1 /arm/skin does not move: its samples lie at 1-10"]),
        (30, 30, ["in frame 30 /arm/skin does not move: its samples lie at 1-10"]),
        (9, 30, []),
        (4, 4, []),
        (10, 10, []),
    ):
        arm.SetStartTimeCode(first)
        arm.SetEndTimeCode(last)
        arm.Save()
        assert Scene(tmp_path / "arm.usda").warnings == expected


def test_rest_and_transforms_are_those_of_the_frame(tmp_path: Path) -> None:
    stage = animated(tmp_path / "a.usda", [n / 24 for n in range(25)], 1, 24)
    scale = UsdGeom.Xformable(stage.GetPrimAtPath("/mesh")).AddScaleOp()
    for time, by in ((0, 1), (0.5, 2), (1, 3)):
        scale.Set((by, 1, 1), time)
    stage.Save()
    scene = Scene(tmp_path / "a.usda", SceneOptions(fps=24, rest="frame:12", world=True))
    assert scene.positions("mesh", 12)[2, 0] == pytest.approx(2 * 3.2) == scene.shapes[0].rest[2, 0]
    assert scene.positions("mesh", 24)[2, 0] == pytest.approx(3 * 4.4)
    assert Scene(tmp_path / "a.usda", SceneOptions(fps=24)).shapes[0].rest_from == "first frame 0"


def test_files_are_bound_at_the_time_code_of_their_pose(tmp_path: Path) -> None:
    stage = animated(tmp_path / "a.usda", [n / 24 for n in range(25)], 1, 24)
    scenes.bind(stage.GetPrimAtPath("/mesh"), scenes.materialx_material(stage, "/material"))
    stage.Save()
    with Scene(tmp_path / "a.usda", SceneOptions(fps="file")) as scene:
        (shape,) = scene.shapes
        for frame in scene.frames:
            uvs = np.full((len(shape.indices), 2), frame, np.float32)
            write_corner_uvs(tmp_path / f"corners.{frame}.usdc", shape, frame, uvs)
        stages = []
        for name, paths in (
            ("maps", {"map_path": lambda shape, frame, udim: f"./map.{frame}.exr"}),
            ("corners", {"corner_path": lambda shape, frame: f"./corners.{frame}.usdc"}),
        ):
            plan = LayerPlan(scene.frames, ("mesh",), time_of=scene.clock.time, **paths)
            write_layer(tmp_path / f"{name}.usda", scene, plan)
            layer = Sdf.Layer.FindOrOpen(str(tmp_path / f"{name}.usda"))
            layer.subLayerPaths = ["./a.usda"]
            stages.append(Usd.Stage.Open(layer))
    assert [over.GetTimeCodesPerSecond() for over in stages] == [1, 1]
    redirected = next(prim for prim in stages[0].Traverse() if prim.GetName() == "vrtm_redirected")
    found = redirected.GetAttribute("inputs:file")
    corners = UsdGeom.PrimvarsAPI(stages[1].GetPrimAtPath("/mesh")).GetPrimvar("st_redirected")
    for frame in (0, 1, 7, 24):
        assert found.Get(frame / 24).path == f"./map.{frame}.exr"
        assert corners.Get(frame / 24)[0] == (frame, frame)
    assert found.GetTimeSamples() == [frame / 24 for frame in range(25)]


def test_rates_that_cannot_be(tmp_path: Path) -> None:
    animated(tmp_path / "a.usda", [1, 2], 24, math.inf)
    with pytest.raises(SceneError, match=r"a\.usda: --fps cannot count inf frames and 24 time codes per second"):
        Scene(tmp_path / "a.usda", FILE)
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n")
    with pytest.raises(SceneError, match="have numbers and no times, which --fps asks for"):
        Scene(tmp_path / "a.obj", SceneOptions(fps=24))
    parser = parsing.Parser(prog="vrtm")
    arguments.add_to(parser.add_subparsers(dest="command"))
    assert [parser.parse_args(["bake", "a.abc", "--fps", fps]).fps for fps in ("file", "23.976")] == ["file", 23.976]
    refused(SystemExit, "", parser.parse_args, ["bake", "a.abc", "--fps", str(math.nan)])
