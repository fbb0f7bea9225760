"""Warnings of a bake that changes nothing, or less than it seems."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade

from bake_scenes import files, image, run, sheet, sheet_arguments
from scenes import bind, preview_material

STACKED, FREE = "/model/stacked", "/model/free"


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two meshes that are stretched, of two quadrilaterals each: one's lie over the same UVs, the other's side by side.
    Everything on them is rigid."""
    folder = tmp_path_factory.mktemp("stacked")
    stage = Usd.Stage.CreateNew(str(folder / "shot.usda"))
    stage.SetStartTimeCode(1)
    stage.SetEndTimeCode(4)
    corners = [(0, 0), (1, 0), (1, 1), (0, 1)]
    for path, apart in ((STACKED, 0.0), (FREE, 0.5)):
        mesh = UsdGeom.Mesh.Define(stage, path)
        mesh.CreateSubdivisionSchemeAttr("none")
        points = [Gf.Vec3f(x + 2 * face, y, 0) for face in range(2) for x, y in corners]
        attribute = mesh.CreatePointsAttr(points)
        for frame in range(1, 5):
            attribute.Set([Gf.Vec3f(p[0], p[1] * (1 + 0.1 * frame * p[0]), p[2]) for p in points], frame)
        mesh.CreateFaceVertexCountsAttr([4, 4])
        mesh.CreateFaceVertexIndicesAttr(list(range(8)))
        primvars = UsdGeom.PrimvarsAPI(mesh)
        kinds = Sdf.ValueTypeNames
        rest = primvars.CreatePrimvar("Pref", kinds.Point3fArray, UsdGeom.Tokens.vertex)
        rest.Set(points)
        uvs = [(0.1 + 0.35 * x + apart * face, 0.1 + 0.8 * y) for face in range(2) for x, y in corners]
        primvars.CreatePrimvar("st", kinds.TexCoord2fArray, UsdGeom.Tokens.vertex).Set([Gf.Vec2f(*uv) for uv in uvs])
    stage.Save()
    image(folder / "rigid.png", np.full((64, 64, 1), 255, np.uint8))
    return folder / "shot.usda"


def bake(scene: Path, out: Path, *more: object) -> list[object]:
    rigidity = scene.parent / "rigid.png"
    return ["bake", scene, "--rigidity", rigidity, "--overlap", "fixed", "--device", "cpu", "--out", out, *more]


@pytest.mark.parametrize("jobs", [1, 2])
def test_stacked_uvs_are_told_and_not_within_a_tolerance(scene: Path, tmp_path: Path, jobs: int) -> None:
    report = tmp_path / "report.json"
    for state in ("written", "skipped"):
        options = ("--jobs", jobs, "--max-strain", 0.9, "--report", report)
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
        assert (
            document["exit_code"] == 3
            and [line.removeprefix("vrtm: warning: ") for line in told] == document["warnings"]
        )
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


def test_strain_is_that_of_all_rigid_edges(scene: Path, tmp_path: Path) -> None:
    # The same stretch, of edges that may move or not: before, it is the same strain.
    report = tmp_path / "report.json"
    run(*bake(scene, tmp_path / "out", "--measure", "--frames", 4, "--report", report))
    free, stacked = (frame["tiles"][0]["strain"] for frame in json.loads(report.read_text())["frames"])
    # The layer below is not seen twice.
    assert stacked["segments"] < 0.6 * free["segments"]
    assert 0.1 < stacked["before"]["rms"] < free["before"]["rms"] * 1.5


def test_a_pose_in_another_unit_ends_the_bake(tmp_path: Path) -> None:
    scene = sheet(tmp_path, frames=6, cells=4)
    stage = Usd.Stage.Open(str(scene))
    points = stage.GetPrimAtPath("/model/sheet").GetAttribute("points")
    for frame in range(2, 7):
        points.Set([p * 100 for p in points.Get(frame)], frame)
    stage.Save()
    for jobs in (1, 2):
        arguments = sheet_arguments(scene, tmp_path / f"{jobs}", "--jobs", jobs)
        last = run(*arguments, expect=2).stderr.splitlines()[-1]
        assert "/model/sheet, frame " in last and "times as long as at rest (median; the rest is from Pref)" in last
        assert "--allow-units" in last and not (tmp_path / f"{jobs}" / "redirect.0002.1001.exr").exists()
        # Else each worker tells, of a few frames.
        ended = run(*arguments, "--allow-units", "--report", tmp_path / "r.json", "--overwrite")
        told = [line for line in ended.stderr.splitlines() if "other units" in line]
        assert len(told) == 3 and all(line.startswith("vrtm: warning: /model/sheet, frame ") for line in told)
        assert ended.stderr.count("/model/sheet: the same of further frames") == 1
        frames = json.loads((tmp_path / "r.json").read_text())["frames"]
        assert [frame["frame"] for frame in frames if any("other units" in w for w in frame["warnings"])] == [
            2,
            3,
            4,
            5,
            6,
        ]


@pytest.mark.parametrize("jobs", [1, 2])
def test_a_pose_that_tears_in_many_frames_is_told_once(tmp_path: Path, jobs: int) -> None:
    # Two strips whose sides at x = 1 are welded by position. Each frame pulls one vertex more apart.
    count = 8
    line = [[(x, j / count, 0.0) for j in range(count + 1)] for x in (0.0, 1.0, 1.0, 2.0)]
    points = [point for column in line for point in column]
    stage = Usd.Stage.CreateNew(str(tmp_path / "tear.usda"))
    stage.SetStartTimeCode(1)
    stage.SetEndTimeCode(4)
    mesh = UsdGeom.Mesh.Define(stage, "/model/strips")
    mesh.CreateSubdivisionSchemeAttr("none")
    attribute = mesh.CreatePointsAttr()
    for frame in range(1, 5):
        pulled = range(2 * (count + 1), 2 * (count + 1) + frame + 1)
        posed = [(x + 0.1 * (k in pulled), 1.1 * y, z) for k, (x, y, z) in enumerate(points)]
        attribute.Set([Gf.Vec3f(*p) for p in posed], frame)
    corners = [
        first + j + step
        for first in (0, 2 * (count + 1))
        for j in range(count)
        for step in (0, count + 1, count + 2, 1)
    ]
    mesh.CreateFaceVertexCountsAttr([4] * (len(corners) // 4))
    mesh.CreateFaceVertexIndicesAttr(corners)
    primvars, kinds = UsdGeom.PrimvarsAPI(mesh), Sdf.ValueTypeNames
    rest = primvars.CreatePrimvar("Pref", kinds.Point3fArray, UsdGeom.Tokens.vertex)
    rest.Set([Gf.Vec3f(*p) for p in points])
    uvs = primvars.CreatePrimvar("st", kinds.TexCoord2fArray, UsdGeom.Tokens.vertex)
    uvs.Set([Gf.Vec2f(0.1 + 0.4 * x, 0.1 + 0.8 * y) for x, y, _ in points])
    stage.Save()
    image(tmp_path / "rigid.png", np.full((32, 32, 1), 255, np.uint8))
    arguments = bake(tmp_path / "tear.usda", tmp_path / "out", "--weld", "position", "--jobs", jobs)
    told = [line for line in run(*arguments).stderr.splitlines() if "welded edges" in line]
    assert len(told) == 1 and told[0].startswith("vrtm: warning: /model/strips: tile 1001: the pose tears"), told


def test_missing_rigidity_is_told_and_may_be_an_error(tmp_path: Path) -> None:
    scene = sheet(tmp_path / "maps", frames=1, cells=4)
    (scene.parent / "rigid.1002.png").unlink()
    arguments = sheet_arguments(scene, tmp_path / "out", "--jobs", 1)
    assert "warning: /model/sheet, tile 1002: no map of --rigidity: nothing keeps" in run(*arguments).stderr
    shutil.rmtree(tmp_path / "out")
    ended = run(*arguments, "--strict", expect=2)
    assert ended.stderr.splitlines()[-1].startswith("vrtm: --strict: /model/sheet, tile 1002: no map of --rigidity")
    assert not (tmp_path / "out").exists()
    # A tile that is not asked for is nobody's matter.
    assert "no map of" not in run(*arguments, "--strict", "--tiles", 1001).stderr
    # By the name of the mesh; one map is black.
    (scene.parent / "rigid.1001.png").rename(scene.parent / "sheet.1001.png")
    image(scene.parent / "sheet.1002.png", np.zeros((8, 8, 1), np.uint8))
    named = [scene.parent / "<mesh>.<UDIM>.png" if str(a).endswith("rigid.<UDIM>.png") else a for a in arguments]
    told = run(*named, "--strict").stderr
    assert "sheet.1002.png is black all over" in told and "no map of" not in told
    named = [scene.parent / "none.<mesh>.<UDIM>.png" if str(a).endswith("<mesh>.<UDIM>.png") else a for a in named]
    assert "/model/sheet, tiles 1001-1002: no map of --rigidity" in run(*named).stderr
    # By values per vertex, which one of two meshes lacks.
    stage = Usd.Stage.Open(str(scene))
    other = Sdf.Layer.FindOrOpen(str(scene))
    Sdf.CopySpec(other, "/model/sheet", other, "/model/other")
    values = UsdGeom.PrimvarsAPI(stage.GetPrimAtPath("/model/other")).CreatePrimvar(
        "rigid", Sdf.ValueTypeNames.FloatArray, UsdGeom.Tokens.vertex
    )
    values.Set([1.0] * 50)
    stage.Save()
    by_vertex = [
        "bake",
        scene,
        "--rigidity-primvar",
        "rigid",
        "--device",
        "cpu",
        "--size",
        32,
        "--out",
        tmp_path / "new",
    ]
    assert "/model/sheet, tiles 1001-1002: no values of --rigidity-primvar" in run(*by_vertex).stderr
    assert "/model/sheet" in run(*by_vertex, "--strict", expect=2).stderr


def test_a_layer_that_redirects_nothing_says_what_to_give(tmp_path: Path) -> None:
    scene = sheet(tmp_path / "shot", frames=1, cells=4)
    layer, report = tmp_path / "over.usda", tmp_path / "report.json"
    arguments = sheet_arguments(scene, tmp_path / "out", "--layer", layer, "--report", report)

    def refused() -> None:
        ended = run(*arguments, expect=3)
        last = ended.stderr.splitlines()[-1]
        assert "over.usda: it redirects nothing" in last and "--texture" in last and "--layer-mode primvar" in last
        # All files are there.
        assert layer.exists() and len(files(tmp_path / "out")) == 2
        assert json.loads(report.read_text())["exit_code"] == 3
        # It is known before anything is baked.
        ended = run(*arguments, "--dry-run")
        assert "over.usda: it redirects nothing" in ended.stderr.splitlines()[-1]

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
    assert "a stronger binding keeps" in run(*arguments, expect=3).stderr
