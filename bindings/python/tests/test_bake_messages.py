"""Messages of a bake: meshes left out, likely mistakes, dry runs, logs, mistyped names, and warnings of a bake that
changes nothing, or less than it seems."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from pxr import Gf, Usd, UsdShade

import scenes
from bake_scenes import MESH, files, flat, image, run, sheet, sheet_arguments, with_copies, with_material
from conftest import grid

STACKED, FREE = "/model/stacked", "/model/free"


def test_what_does_not_deform_is_left_out(tmp_path: Path) -> None:
    scene = sheet(tmp_path / "shot", frames=2, cells=4)
    stage = with_copies(scene, "rock", "stone", "bent")
    for name in ("rock", "stone", "bent"):
        points = stage.GetPrimAtPath(f"/model/{name}").GetAttribute("points")
        rest = points.Get()
        points.Clear()
        points.Set(rest)
    # One that is bent once and for all deforms.
    points.Set([Gf.Vec3f(p[0] * (1 + 0.1 * p[0]), p[1], p[2]) for p in points.Get()])
    stage.Save()
    ended = run(*sheet_arguments(scene, tmp_path / "out"))
    assert "not baked:\n  /model/rock and another mesh: nothing deforms there; --meshes can name it" in ended.stdout
    assert ended.stderr == ""
    assert {name.split(".")[0] for name in files(tmp_path / "out")} == {"sheet", "bent"}
    # They share their maps, which may be meant.
    (hint,) = [line for line in ended.stdout.splitlines() if "share" in line]
    assert hint.startswith("/model/") and "rigid.1001.png: with <mesh> in --rigidity each has its own" in hint
    # Those that are named are baked.
    run(*sheet_arguments(scene, tmp_path / "named", "--meshes", "rock", "sheet"))
    assert {name.split(".")[0] for name in files(tmp_path / "named")} == {"sheet", "rock"}
    stage.RemovePrim(MESH)
    stage.RemovePrim("/model/bent")
    stage.Save()
    ended = run(*sheet_arguments(scene, tmp_path / "none"), expect=2)
    assert "nothing deforms: /model/rock and another mesh can be baked if --meshes names it" in ended.stderr


def test_what_seems_meant_otherwise_is_said(scene: Path, tmp_path: Path) -> None:
    arguments = sheet_arguments(scene, tmp_path / "out", "--frames", "1-2")
    for more, words in (
        (("--rest", "frame:99"), "--rest frame:99: "),
        (("--half",), "--half: numbers of 16 bits are off"),
        (("--texture", scene.parent / "only.<UDIM>.png"), "only.<UDIM>.png has no file of tile 1002"),
    ):
        if "only" in words:
            (scene.parent / "only.1001.png").write_bytes((scene.parent / "colour.1001.png").read_bytes())
        (warning,) = run(*arguments, *more, "--dry-run").stderr.splitlines()
        assert warning.startswith("vrtm: warning: ") and words in warning
    assert "no such file, and none of bind, pref" in run(*arguments, "--rest", "nope.usd", expect=2).stderr
    # A pose that has collapsed is in no other unit.
    flat = sheet(tmp_path / "flat", frames=1, cells=4)
    stage = Usd.Stage.Open(str(flat))
    points = stage.GetPrimAtPath(MESH).GetAttribute("points")
    points.Set([Gf.Vec3f(0, 0, 0)] * len(points.Get(1)), 1)
    stage.Save()
    run(*sheet_arguments(flat, tmp_path / "collapsed"))


def test_cages_of_surfaces_that_renderers_smooth_are_told_once(tmp_path: Path) -> None:
    scene = sheet(tmp_path / "shot", frames=2, cells=4)
    stage = with_copies(scene, "other", "flat", "bent", "tri")
    for name, scheme in {"other": "catmullClark", "flat": "none", "bent": "bilinear", "tri": "loop"}.items():
        stage.GetPrimAtPath(f"/model/{name}").GetAttribute("subdivisionScheme").Set(scheme)
    # A mesh that states no scheme is a Catmull-Clark surface.
    stage.GetPrimAtPath(MESH).RemoveProperty("subdivisionScheme")
    stage.Save()
    arguments = sheet_arguments(scene, tmp_path / "out", "--dry-run")
    told, is_one = run(*arguments).stdout.splitlines(), "renderers smooth this subdivision surface"
    assert [line for line in told if "smooth" in line] == [
        f"{MESH} and another mesh: {is_one} (catmullClark), and its cage is baked: --subdivide 2 refines it",
        f"/model/tri: {is_one} (loop), and its cage is baked: its scheme cannot be refined",
    ]
    assert "smooth" not in run(*arguments, "--subdivide", 1, "--exclude", "tri").stdout


def test_maps_of_another_mesh_or_form_are_not_lost_without_a_word(tmp_path: Path) -> None:
    scene = with_material(tmp_path / "shot")
    with_copies(scene, "other").Save()
    layer = tmp_path / "over.usda"
    arguments = sheet_arguments(scene, tmp_path / "out", "--meshes")
    run(*arguments, "sheet", "--layer", layer)
    before = files(tmp_path / "out")
    ended = run(*arguments, "other", expect=2)
    assert "redirect.0001.1001.exr holds the maps of the mesh sheet: --overwrite" in ended.stderr
    ended = run(*sheet_arguments(scene, tmp_path / "new", "--meshes", "other", "--layer", layer), expect=2)
    assert "it redirects /model/sheet, too, which is lost: --overwrite replaces it" in ended.stderr
    assert files(tmp_path / "out") == before
    # A layer of several meshes takes the place of one of them.
    run(*sheet_arguments(scene, tmp_path / "both", "--layer", layer))
    # The form that a layer needs, and another.
    ended = run(*arguments, "sheet")
    assert "6 maps of another form, such as " in ended.stderr and "replaced by ones of form tile" in ended.stderr
    ended = run(*arguments, "sheet", "--layer", tmp_path / "again.usda", "--only-layer", expect=3)
    assert "6 of the maps are not of form udim, such as " in ended.stderr
    ended = run(*arguments, "sheet", "--layer", tmp_path / "again.usda", "--frames", "1,3")
    assert "frames 2 of the scene are not in it, and show the ones before them" in ended.stderr


def test_a_dry_run_tells_and_writes_nothing(scene: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    options = ("--dry-run", "--report", out / "r.json", "--texture", scene.parent / "colour.<UDIM>.png", "--warp")
    options += ("--seams", "shut", "--open-borders", "fixed")
    told = run(*sheet_arguments(scene, out, *options)).stdout
    for words in (
        "device: cpu, ",
        "rest: Pref: /model/sheet",
        "frames: 1-5 of 1-5",
        "/model/sheet: UV set st, 162 vertices, rest: Pref",
        f"tile 1002: grid 64 x 64, maps 64 x 64, rigidity {scene.parent / 'rigid.1002.png'}, colour {scene.parent}",
        "may move; ",
        "files: 30 below ",
        f"report: {out / 'r.json'}",
        "memory: 1 MB per job, besides the scene; at most ",
    ):
        assert words in told, f"'{words}' in {told}"
    assert "--tiles" in run(*sheet_arguments(scene, out, "--dry-run", "--tiles", 1050), expect=2).stderr
    # Whoever is to paint the maps has to know the tiles.
    for size, which in (("auto", "grid by the features, maps as the rigidity map"), (32, "grid 32 x 32, maps 32 x 32")):
        told = run("bake", scene, "--dry-run", "--device", "cpu", "--out", out, "--size", size).stdout
        lines = "\n".join(f"  tile {udim}: {which}, no rigidity" for udim in (1001, 1002))
        assert f"frames: 1-5 of 1-5\n/model/sheet: UV set st, 162 vertices, rest: Pref\n{lines}\nfiles" in told, told
    assert not out.exists()


def test_a_log_keeps_what_is_said(scene: Path, tmp_path: Path) -> None:
    log = tmp_path / "bake.log"
    arguments = sheet_arguments(scene, tmp_path / "out", "--log", log, "--frames", "1-2,9")
    assert run(*arguments, "--quiet").stdout == ""
    first = log.read_text()
    for words in (
        "# vrtm bake log\n",
        "device: cpu",
        "warning: frame 9: the scene has 1-5",
        "[2/2] sheet, frame 2",
        "detail: written: ",
    ):
        assert words in first, words
    assert "4 files written, 0 up to date" in first
    verbose = run(*arguments, "--verbose").stdout
    assert log.read_text().startswith(first) and "4 up to date" in log.read_text()[len(first) :]
    assert f"skipped: {tmp_path / 'out' / 'redirect.0001.1001.exr'}" in verbose
    # An error is in it, too; another program's file is not touched.
    run(*arguments, "--meshes", "nobody", expect=2)
    assert "error: " in log.read_text().splitlines()[-1] and "nobody" in log.read_text().splitlines()[-1]
    for name, content in (("notes.txt", b"mine\n"), ("image.bin", bytes(range(256)))):
        (tmp_path / name).write_bytes(content)
        ended = run(*arguments, "--log", tmp_path / name, "--overwrite", expect=2)
        assert "is no log of vrtm" in ended.stderr and (tmp_path / name).read_bytes() == content
    assert "--log" in run(*arguments, "--log", tmp_path / "none" / "a.log", expect=2).stderr
    # The log is no file for an output.
    ended = run(*arguments, "--report", log, "--overwrite", expect=2)
    assert log.read_text().startswith(first)


def test_help_has_the_usual_options_first() -> None:
    usual, every = (run("bake", option).stdout for option in ("--help", "--help-all"))
    assert len(re.findall(r"^  --", usual, re.M)) == 10 + len(["--help-all"])
    assert every.index("--dry-run") < every.index("--uv") and "--uv" not in usual
    # Each option has a sentence.
    told = re.split(r"\n\n[a-zU].*:\n", every.split("exit codes:")[0])[1:]
    options = [" ".join(text.split()) for part in told for text in re.split(r"^  (?=-|SCENE)", part, flags=re.M)[1:]]
    assert len(options) > 80 and all(text.endswith((".", ")", "'")) for text in options), options


@pytest.fixture(scope="module")
def stacked(tmp_path_factory: pytest.TempPathFactory) -> Path:
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


def test_stacked_uvs_are_told_and_not_within_a_tolerance(stacked: Path, tmp_path: Path) -> None:
    report = tmp_path / "report.json"
    for state in ("written", "skipped"):
        options = ("--jobs", 2, "--max-strain", 0.9, "--report", report)
        ended = run(*bake(stacked, tmp_path / "out", *options), expect=3)
        told = [line for line in ended.stderr.splitlines() if line.startswith("vrtm: warning: ")]
        # Once per mesh and tile, whatever the number of processes and frames.
        fixed = [line for line in told if "of its rigid texels are fixed" in line]
        remedy = "with --overlap each charts that lie over one another each keep their features"
        assert len(fixed) == 1 and f"{STACKED} tile 1001: 100% of" in fixed[0] and fixed[0].endswith(remedy)
        if state == "written":
            overlapped = [line for line in told if "overlapped" in line]
            assert len(overlapped) == 1 and overlapped[0].startswith(f"vrtm: warning: {STACKED}: tile 1001: 100.00 %")
            assert len([line for line in told if "nothing that may move" in line and STACKED in line]) == 1
        assert f"{STACKED} tile 1001: 100.0% of the rigid texels are fixed, 100.0% overlapped" in ended.stdout
        last = ended.stderr.splitlines()[-1]
        assert last.startswith("vrtm: --max-strain cannot be met in 4 of 8: stacked, frame 1, tile 1001: ")
        assert last.endswith(remedy)
        document = json.loads(report.read_text())
        assert document["exit_code"] == 3
        assert [line.removeprefix("vrtm: warning: ") for line in told] == document["warnings"]
        for frame in document["frames"]:
            (tile,) = frame["tiles"]
            strain = tile["strain"]
            assert tile["state"] == state and strain["before"]["rms"] > 0.02 * frame["frame"]
            if frame["mesh"] == "stacked":
                rigid = tile["rigid"]
                assert (tile["overlap"], tile["fixed"], tile["movable"]) == (1.0, 1.0, 0.0)
                assert (rigid["overlapped"], rigid["fixed"], rigid["movable"]) == (1.0, 1.0, 0.0)
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
    scenes.bind(stage.GetPrimAtPath(MESH), scenes.preview_material(stage, "/model/material"))
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
