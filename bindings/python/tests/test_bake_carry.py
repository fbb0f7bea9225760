"""`vrtm bake --carry-prims`: what rides on a sheet that is stretched and turned, against its own arithmetic."""

import json
from pathlib import Path

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom

import scenes
from bake_scenes import files, image, run
from conftest import centres, grid
from vrtm.bake.carry import Group

MESH, SCALES = "/model/skin", "/model/scales"
STRETCH = np.diag([1.5, 1.0, 1.0])
TURN = np.array(Gf.Matrix3d(Gf.Rotation(Gf.Vec3d(1, 2, 3), 40))).T
"""Of columns."""
STEP = np.array([0.3, -0.2, 0.5])
PLACES = np.array([(0.2, 0.3, 0.0), (0.7, 0.6, 0.01), (0.45, 0.8, -0.01), (0.52, 0.5, 0.02)])


def posed(points: np.ndarray) -> np.ndarray:
    """Points on or above the sheet in frame 2: heights are not stretched."""
    return points @ STRETCH @ TURN.T + STEP


def scene(folder: Path, radius: float = 0.0) -> Usd.Stage:
    """A unit square at z = 0, whose second frame is stretched and turned, with a painted disc that is rigid."""
    stage = scenes.stage(folder / "skin.usda", 1, 2, fps=None)
    stage.SetTimeCodesPerSecond(25)
    UsdGeom.Xform.Define(stage, "/model")
    rest, faces = grid(6)
    scenes.mesh(stage, MESH, rest, 0.1 + 0.8 * rest[:, :2], faces=faces, poses={1: rest, 2: posed(rest)})
    u, v = centres(64)
    rigid = np.hypot(u - 0.5, v - 0.5) < 0.8 * radius
    image(folder / "rigid.png", np.where(rigid, 255, 0).astype(np.uint8)[..., None])
    return stage


@pytest.fixture
def stage(tmp_path: Path) -> Usd.Stage:
    return scene(tmp_path)


def scales(stage: Usd.Stage, places: np.ndarray = PLACES, path: str = SCALES) -> UsdGeom.PointInstancer:
    """Instances with orientations of their own."""
    of = UsdGeom.PointInstancer.Define(stage, path)
    UsdGeom.Sphere.Define(stage, f"{path}/ball").CreateRadiusAttr(0.01)
    of.CreatePrototypesRel().AddTarget(f"{path}/ball")
    of.CreateProtoIndicesAttr([0] * len(places))
    of.CreatePositionsAttr(np.float32(places))
    of.CreateScalesAttr([Gf.Vec3f(1, 2, 3)] * len(places))
    of.CreateVelocitiesAttr([Gf.Vec3f(9)] * len(places))
    turns = [Gf.Rotation(Gf.Vec3d(1, k, -1), 25.0 * k).GetQuat() for k in range(len(places))]
    of.CreateOrientationsAttr([Gf.Quath(Gf.Quatf(q)) for q in turns])
    return of


def bake(
    folder: Path,
    stage: Usd.Stage | None,
    *more: object,
    expect: int | None = 0,
    file: str = "skin.usda",
    meshes: str = "skin",
) -> str:
    """Output of a bake of a scene in a folder; `stage`: is saved before."""
    if stage is not None:
        stage.Save()
    arguments = ("--rigidity", folder / "rigid.png", "--size", 32, "--meshes", meshes, "--device", "cpu", "--jobs", 1)
    ended = run("bake", folder / file, *arguments, "--out", folder / "out", *more, expect=expect)
    return ended.stdout + ended.stderr


def carried(folder: Path) -> Usd.Stage:
    """The layer over the shot."""
    root = Sdf.Layer.CreateAnonymous(".usda")
    below = [str(path) for path in (folder / "skin.usda", folder / "scatter.usda") if path.exists()]
    root.subLayerPaths = [str(folder / "out" / "carried.usdc"), *below]
    root.pseudoRoot.SetInfo("timeCodesPerSecond", 25.0)
    return Usd.Stage.Open(root)


def values(folder: Path, path: str, frame: int) -> np.ndarray:
    stage = carried(folder)
    prim = stage.GetPrimAtPath(path)
    of = UsdGeom.PointInstancer(prim).GetPositionsAttr() if prim.IsA(UsdGeom.PointInstancer) else None
    return np.array((of or UsdGeom.PointBased(prim).GetPointsAttr()).Get(frame), np.float64)


def turns_at(folder: Path, frame: int) -> list[np.ndarray]:
    """The matrices of instances, of columns."""
    stage = carried(folder)
    of = UsdGeom.PointInstancer(stage.GetPrimAtPath(SCALES)).GetOrientationsAttr().Get(frame)
    return [np.array(Gf.Matrix3d(Gf.Quatd(Gf.Quatf(q)).GetNormalized())).T for q in of]


def test_instances_ride_on_a_stretched_plane(tmp_path: Path, stage: Usd.Stage) -> None:
    before = [np.array(Gf.Matrix3d(Gf.Quatd(Gf.Quatf(q)))).T for q in scales(stage).GetOrientationsAttr().Get()]
    said = bake(tmp_path, stage, "--carry-prims", SCALES)
    assert "carries 4 places, 0 rigid features; 0 outside of UVs, 0 too far" in said
    np.testing.assert_allclose(values(tmp_path, SCALES, 1), PLACES, atol=1e-6)
    np.testing.assert_allclose(values(tmp_path, SCALES, 2), posed(PLACES), atol=1e-5)
    for frame, turn in ((1, np.eye(3)), (2, TURN)):
        for found, own in zip(turns_at(tmp_path, frame), before, strict=True):
            # Halves have 11 bits.
            np.testing.assert_allclose(found, turn @ own, atol=2e-3)
    shot = carried(tmp_path)
    of = UsdGeom.PointInstancer(shot.GetPrimAtPath(SCALES))
    assert of.GetScalesAttr().Get(2)[0] == Gf.Vec3f(1, 2, 3) and not of.GetVelocitiesAttr().Get(2)
    low, high = np.array(of.GetExtentAttr().Get(2))
    assert (low < posed(PLACES).min(0)).all() and (high > posed(PLACES).max(0)).all() and (high - low < 2).all()
    assert Sdf.Layer.FindOrOpen(str(tmp_path / "out" / "carried.usdc")).timeCodesPerSecond == 25


def test_transforms_above_both(tmp_path: Path, stage: Usd.Stage) -> None:
    scales(stage)
    whole = UsdGeom.Xformable(stage.GetPrimAtPath("/model"))
    whole.AddTranslateOp().Set(Gf.Vec3d(5, 6, 7))
    whole.AddRotateXYZOp().Set(Gf.Vec3f(30, 40, 50))
    whole.AddScaleOp().Set(Gf.Vec3f(2))
    # The skin moves along, and the scatter has another space of its own.
    moves = UsdGeom.Xformable(stage.GetPrimAtPath(MESH)).AddTransformOp()
    at = {f: Gf.Matrix4d(Gf.Rotation(Gf.Vec3d(0, 1, 1), 20.0 * f), Gf.Vec3d(f, 0, 1)) for f in (1, 2)}
    for frame, matrix in at.items():
        moves.Set(matrix, frame)
    own = Gf.Matrix4d().SetScale(0.5) * Gf.Matrix4d(Gf.Rotation(Gf.Vec3d(1, 1, 0), 70), Gf.Vec3d(3, 2, 1))
    UsdGeom.Xformable(stage.GetPrimAtPath(SCALES)).AddTransformOp().Set(own)
    # Places in the scatter's space that lie on the skin at rest.
    local = np.array([list((at[1] * own.GetInverse()).Transform(Gf.Vec3d(*map(float, p)))) for p in PLACES])
    of = UsdGeom.PointInstancer(stage.GetPrimAtPath(SCALES))
    of.GetPositionsAttr().Set(np.float32(local))
    turns = [np.array(Gf.Matrix3d(Gf.Quatd(Gf.Quatf(q)))).T for q in of.GetOrientationsAttr().Get()]
    bake(tmp_path, stage, "--carry-prims", SCALES)
    back = own.GetInverse()
    want = [list(back.Transform(at[2].Transform(Gf.Vec3d(*map(float, p))))) for p in posed(PLACES)]
    np.testing.assert_allclose(values(tmp_path, SCALES, 2), want, atol=3e-5)
    np.testing.assert_allclose(values(tmp_path, SCALES, 1), local, atol=3e-5)
    rotations = (matrix.ExtractRotation() for matrix in (at[1], at[2], own.GetOrthonormalized()))
    first, second, mine = (np.array(Gf.Matrix3d(rotation)).T for rotation in rotations)
    turn = mine.T @ second @ TURN @ first.T @ mine
    for found, turned in zip(turns_at(tmp_path, 2), turns, strict=True):
        np.testing.assert_allclose(found, turn @ turned, atol=2e-3)


def stud(stage: Usd.Stage) -> np.ndarray:
    """A dome of detail over the middle of the sheet; returns the pairs of points of its edges."""
    square, faces = grid(4)
    x, y, _ = 0.15 * (square - 0.5).T
    scenes.mesh(stage, "/model/stud", np.stack([0.5 + x, 0.5 + y, 0.04 - 2 * (x**2 + y**2)], -1), None, faces=faces)
    return np.concatenate([faces[:, [k, (k + 1) % 4]] for k in range(4)])


def lengths(folder: Path, edges: np.ndarray, frame: int) -> np.ndarray:
    points = values(folder, "/model/stud", frame)
    return np.linalg.norm(points[edges[:, 0]] - points[edges[:, 1]], axis=1)


def test_a_stud_on_a_painted_feature_keeps_its_edges(tmp_path: Path) -> None:
    stage = scene(tmp_path, radius=0.25)
    edges = stud(stage)
    # It has no UVs, moves with the shot, and needs no maps.
    detail = UsdGeom.Mesh(stage.GetPrimAtPath("/model/stud")).GetPointsAttr()
    detail.Set(detail.Get(), 1)
    detail.Set(posed(np.array(detail.Get(1))), 2)
    asked = ("--carry-prims", "/model/stud", "--strict", "--report", tmp_path / "report.json")
    said = bake(tmp_path, stage, *asked, meshes="*")
    assert "carries 25 places, 1 rigid feature, whose rims leave the surface by " in said
    rest = lengths(tmp_path, edges, 1)
    np.testing.assert_allclose(lengths(tmp_path, edges, 2), rest, rtol=1e-4)
    [row] = json.loads((tmp_path / "report.json").read_text())["carried"]
    assert row["mesh"] == "skin" and row["features"] == 1 and 0 <= row["rim"] < 0.1
    assert row["prims"] == [
        {"prim": "/model/stud", "kind": "mesh", "places": 25, "bound": 25, "outside": 0, "folded": 0, "too_far": 0}
    ]
    bake(tmp_path, stage, "--carry-prims", "/model/stud", "--carry-fit", "none")
    assert (lengths(tmp_path, edges, 2) / rest).max() > 1.45, "with the skin alone it is stretched"


def test_curves_keep_their_shape_and_points_are_on_the_skin(tmp_path: Path, stage: Usd.Stage) -> None:
    hair = UsdGeom.BasisCurves.Define(stage, "/model/fur/hair")
    hair.CreateTypeAttr("linear")
    hair.CreateCurveVertexCountsAttr([3, 2])
    points = np.array([(0.2, 0.3, 0), (0.25, 0.32, 0.1), (0.4, 0.3, 0.2), (0.7, 0.7, 0), (0.9, 0.7, 0.3)])
    hair.CreatePointsAttr(np.float32(points))
    UsdGeom.Points.Define(stage, "/model/fur/dots").CreatePointsAttr(np.float32(PLACES))
    said = bake(tmp_path, stage, "--carry-prims", "/model/fur")
    assert "/model/fur/hair: curves, 2 places, carried by /model/skin" in said
    roots = points[[0, 0, 0, 3, 3]]
    want = posed(roots) + (points - roots) @ TURN.T
    np.testing.assert_allclose(values(tmp_path, "/model/fur/hair", 2), want, atol=1e-5)
    np.testing.assert_allclose(values(tmp_path, "/model/fur/dots", 2), posed(PLACES), atol=1e-5)


def test_what_is_far_is_told_and_stays(tmp_path: Path, stage: Usd.Stage) -> None:
    places = np.concatenate([PLACES, [(0.5, 0.5, 0.2), (0.5, 0.5, 3)]])
    scales(stage, places)
    said = bake(tmp_path, stage, "--carry-prims", SCALES)
    # 5 % of the diagonal of a unit square.
    assert f"{SCALES}: 2 of 6 places are farther than 0.07071 (--carry-farthest) from {MESH}, and left where" in said
    np.testing.assert_allclose(values(tmp_path, SCALES, 2), [*posed(PLACES), *places[4:]], atol=1e-5)
    said = bake(tmp_path, stage, "--carry-prims", SCALES, "--carry-farthest", 0.5)
    assert "1 of 6 places is farther than 0.5" in said
    np.testing.assert_allclose(values(tmp_path, SCALES, 2), [*posed(places[:5]), places[5]], atol=1e-5)


def test_what_is_inside_an_instance_is_opened_up(tmp_path: Path, stage: Usd.Stage) -> None:
    """An instance in another one, which has the skin, too, and one beside it that stays."""
    scales(stage)
    stage.GetRootLayer().Export(str(tmp_path / "asset.usda"))
    stage.RemovePrim("/model")
    for path in ("/set/a", "/set/b"):
        scenes.instance(stage, path, "/model", "asset.usda")
    scenes.instance(stage, "/shot", "/set")
    said = bake(tmp_path, stage, "--carry-prims", "/shot/a", meshes="/shot/a/skin")
    assert "/shot/a/scales: instances, 4 places, carried by /shot/a/skin" in said
    for path in ("/shot", "/shot/a"):
        assert f"{path}: is no instance any more, since what is inside is carried" in said
    np.testing.assert_allclose(values(tmp_path, "/shot/a/scales", 2), posed(PLACES), atol=1e-5)
    np.testing.assert_allclose(values(tmp_path, "/shot/b/scales", 2), PLACES, atol=1e-6)


def changing(stage: Usd.Stage) -> None:
    """Prims whose points are others in frame 2, or none at rest, and a curve that is fine."""
    for name, counts in (("/model/more", (4, 3)), ("/model/none", (0, 4))):
        of = scales(stage, PLACES, name)
        for frame, count in enumerate(counts, 1):
            of.GetPositionsAttr().Set(np.float32(PLACES[:count]), frame)
            of.GetProtoIndicesAttr().Set([0] * count, frame)
    UsdGeom.Points.Define(stage, "/model/dots").CreatePointsAttr(np.float32(PLACES))
    for frame in (1, 2):
        UsdGeom.Points(stage.GetPrimAtPath("/model/dots")).CreateIdsAttr().Set([frame, 2, 3, 4], frame)
    scales(stage, PLACES, "/model/odd").GetProtoIndicesAttr().Set([0] * 9)
    hair = UsdGeom.BasisCurves.Define(stage, "/model/hair")
    hair.CreatePointsAttr(np.float32(PLACES))
    hair.CreateCurveVertexCountsAttr([0, 4, 0])


def test_what_cannot_be_bound_is_left_out_and_stops_no_map(tmp_path: Path, stage: Usd.Stage) -> None:
    changing(stage)
    expected = {
        "more": "the number or order of its positions changes, first in frame 2",
        "none": "has no points at rest",
        "dots": "the number or order of its ids changes, first in frame 2",
        "odd": "has 4 positions and 9 protoIndices",
    }
    asked = ("--carry-prims", "/model/hair", *(f"/model/{name}" for name in expected))
    said = bake(tmp_path, stage, *asked)
    for name, why in expected.items():
        assert f"vrtm: warning: /model/{name}: not carried: {why}" in said
    assert "carries 1 place" in said and (tmp_path / "out" / "redirect.0002.1001.exr").exists()
    # A file of before would move what is not carried any more.
    said = bake(tmp_path, stage, "--carry-prims", "/model/none")
    assert "0 files written, 2 up to date" in said and not (tmp_path / "out" / "carried.usdc").exists()
    bake(tmp_path, stage, *asked, "--strict", expect=2)


def test_a_second_run_does_nothing_and_a_change_is_taken(tmp_path: Path, stage: Usd.Stage) -> None:
    of = scales(stage)
    # In no frame the skin is at rest.
    points = UsdGeom.Mesh(stage.GetPrimAtPath(MESH)).GetPointsAttr()
    scenes.primvar(stage.GetPrimAtPath(MESH), "Pref", scenes.TYPES.Point3fArray, points.Get(1), "vertex")
    points.Set(points.Get(2), 1)
    first = bake(tmp_path, stage, "--carry-prims", SCALES)
    before = files(tmp_path / "out")
    again = bake(tmp_path, stage, "--carry-prims", SCALES)
    assert "0 files written, 3 up to date" in again and files(tmp_path / "out") == before
    line = next(line for line in first.splitlines() if "carries" in line)
    assert line in again, "the counts are kept"
    of.GetPositionsAttr().Set(np.float32(np.add(PLACES, [0.01, 0, 0])))
    assert "1 file written, 2 up to date" in bake(tmp_path, stage, "--carry-prims", SCALES)
    np.testing.assert_allclose(values(tmp_path, SCALES, 2), posed(np.add(PLACES, [0.01, 0, 0])), atol=1e-5)
    shot = Sdf.Layer.CreateNew(str(tmp_path / "shot.usda"))
    shot.subLayerPaths = ["out/carried.usdc", "skin.usda"]
    shot.pseudoRoot.SetInfo("timeCodesPerSecond", 25.0)
    shot.Save()
    said = bake(tmp_path, stage, "--carry-prims", SCALES, file="shot.usda")
    assert "0 files written, 3 up to date" in said, "what it has moved is read at rest"
    (tmp_path / "out" / "carried.usdc").write_text('#usda 1.0\n(\n    doc = "mine"\n)\n')
    said = bake(tmp_path, stage, "--carry-prims", SCALES, expect=2)
    assert "carried.usdc is there, and is no file that vrtm has written" in said


def test_a_frame_without_a_pose_is_left_out(tmp_path: Path, stage: Usd.Stage) -> None:
    scales(stage)
    points = UsdGeom.Mesh(stage.GetPrimAtPath(MESH)).GetPointsAttr()
    points.Set([Gf.Vec3f(float("nan"))] * len(points.Get(1)), 3)
    stage.SetEndTimeCode(3)
    assert "carries 4 places" in bake(tmp_path, stage, "--carry-prims", SCALES)
    layer = Sdf.Layer.FindOrOpen(str(tmp_path / "out" / "carried.usdc"))
    assert layer.ListTimeSamplesForPath(f"{SCALES}.positions") == [1, 2]


def test_another_file_with_other_units_and_times_and_the_nearest_of_two_meshes(
    tmp_path: Path, stage: Usd.Stage
) -> None:
    UsdGeom.SetStageMetersPerUnit(stage, 1)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    Sdf.CopySpec(stage.GetRootLayer(), MESH, stage.GetRootLayer(), "/model/other")
    UsdGeom.Xformable(stage.GetPrimAtPath("/model/other")).AddTranslateOp().Set(Gf.Vec3d(0, 0, 2))
    other = Usd.Stage.CreateNew(str(tmp_path / "scatter.usda"))
    UsdGeom.SetStageMetersPerUnit(other, 0.01)
    UsdGeom.SetStageUpAxis(other, UsdGeom.Tokens.y)
    other.SetTimeCodesPerSecond(100)

    def there(points: np.ndarray) -> np.ndarray:
        return 100 * points[:, [0, 2, 1]] * (1, 1, -1)

    scales(other, there(PLACES), "/low")
    scales(other, there(np.add(PLACES, [0, 0, 2])), "/high")
    # At the fourth of its times the shot has its first frame.
    rises = UsdGeom.Xformable(other.GetPrimAtPath("/low")).AddTranslateOp()
    rises.Set(Gf.Vec3d(0), 4)
    rises.Set(Gf.Vec3d(0, 1, 0), 8)
    other.Save()
    more = ("--meshes", "/model/other", "--carry", tmp_path / "scatter.usda", "--carry-prims", "/low", "/high")
    said = bake(tmp_path, stage, *more)
    assert f"/low: instances, 4 places, carried by {MESH}" in said and "carried by /model/other" in said
    np.testing.assert_allclose(values(tmp_path, "/low", 2), there(posed(PLACES)) - (0, 1, 0), atol=1e-3)
    np.testing.assert_allclose(values(tmp_path, "/high", 2), there(np.add(posed(PLACES), [0, 0, 2])), atol=1e-3)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--carry-prims", "/model/scale"), "skin.usda has no such prim: did you mean /model/scales"),
        (("--carry-prims", MESH), "it is none of PointInstancer, Points, BasisCurves, Mesh that is not baked"),
        (("--carry-prims", SCALES, "--carry", "none.usda"), "--carry none.usda: no such file"),
        (("--carry-prims", SCALES, "--carry-farthest", 1e-9), "must be in the world of the mesh at rest"),
    ],
)
def test_what_is_wrong_is_named_before_all_else(tmp_path: Path, stage: Usd.Stage, options: tuple, said: str) -> None:
    scales(stage, np.add(PLACES, [0, 0, 0.005]))
    assert said in bake(tmp_path, stage, *options, expect=2)
    assert not (tmp_path / "out").exists()


def test_tasks_of_a_farm_share_the_frames(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stage = scene(tmp_path, radius=0.25)
    scales(stage)
    points = UsdGeom.Mesh(stage.GetPrimAtPath(MESH)).GetPointsAttr()
    points.Set(points.Get(2), 3)
    stage.SetEndTimeCode(3)
    whole, shared = tmp_path / "whole", tmp_path / "shared"

    def share(out: Path, *more: object) -> str:
        beside = ("--layer", out / "over.usda", "--layer-mode", "primvar", "--report", out / "report.json", "--sheet")
        return bake(tmp_path, stage, "--carry-prims", SCALES, "--out", out, *beside, *more)

    assert "not in it" not in share(whole)
    for task in ("4/4", "2/4", "3/4"):
        share(shared, "--task", task)
    assert share(shared, "--task", "1/4").endswith("--task 1/4: no frame is left for it\n")
    kinds = ("redirect.{}.1001.exr", "corners.{}.usdc", "carried.{}.tif")
    assert set(files(shared)) == {kind.format(frame) for kind in kinds for frame in ("0001", "0002", "0003")}
    assert "0 files written, 3 up to date" in share(shared, "--task", "4/4")
    (shared / "carried.0003.tif").write_bytes((shared / "carried.0003.tif").read_bytes()[:-60])
    assert "1 file written, 2 up to date" in share(shared, "--task", "4/4")
    monkeypatch.setattr(Group, "moved", lambda _: pytest.fail("a frame of a task is solved again"))
    share(shared)
    made, found = ({**files(of), "report.json": b""} for of in (whole, shared))
    assert made.items() <= found.items() and len(found) == len(made) + 3
    monkeypatch.undo()
    said = bake(tmp_path, stage, "--carry-prims", SCALES, "--frames", 2)
    assert "carried.usdc: frames 1,3 of the scene are not in it (tasks of a farm that share the frames need" in said
