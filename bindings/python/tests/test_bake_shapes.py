"""`vrtm bake --basis --blend-shapes`: the file, evaluated by UsdSkel, against the library's own corner UVs."""

import re
from pathlib import Path

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdSkel

import test_bake_basis
from bake_scenes import solved_alone
from conftest import REPOSITORY
from test_bake_basis import BOUND, SIZE, document, gentle
from vrtm.bake.scene import Scene


def bake(folder: Path, *more: object) -> None:
    test_bake_basis.bake(folder, "--blend-shapes", "--max-error", BOUND, *more, expect=None)


@pytest.fixture(scope="module")
def baked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("shapes")
    gentle(folder, 4)
    bake(folder)
    return folder


def snippet() -> str:
    """The page's own way to take UVs from the points."""
    return re.findall(r"```python\n(.*?)```", (REPOSITORY / "docs" / "games.md").read_text(), re.DOTALL)[0]


def opened(path: Path) -> Usd.Stage:
    """In memory, so that what is changed stays out of the layer that others may open."""
    return Usd.Stage.Open(Sdf.Layer.OpenAsAnonymous(str(path)))


def test_usd_evaluates_what_the_frames_have(baked: Path) -> None:
    """By the page's snippet, at each corner of the scene's mesh."""
    told, scene = document(baked)["blend_shapes"], baked / "scene" / "sheet.usda"
    stage = opened(baked / "out" / "basis.usdc")
    exec(snippet(), {"stage": stage})
    root = stage.GetDefaultPrim()
    mesh = UsdGeom.Mesh(root.GetChild("mesh"))
    primvar = UsdGeom.PrimvarsAPI(mesh).GetPrimvar("st")
    assert primvar.GetInterpolation() == "vertex"
    with Scene(str(scene)) as file:
        (shape,) = file.shapes
        poses = {frame: file.positions(shape, frame) for frame in file.frames}
    most = own = 0.0
    for frame, pose in poses.items():
        wanted = solved_alone(scene, frame, 32).corner_uvs()
        points, uvs = np.array(mesh.GetPointsAttr().Get(frame)), np.array(primvar.Get(frame))
        for corner, vertex in enumerate(shape.indices):
            # Among the vertices in its place the one with the nearest UV: the tiles' borders are in one place.
            off = np.linalg.norm(points - pose[vertex], axis=1)
            there = off < 1e-3 * np.ptp(shape.rest, axis=0).max()
            assert there.any()
            most = max(most, SIZE * float(np.linalg.norm(uvs[there] - wanted[corner], axis=1).min()))
            own = max(own, SIZE * float(np.linalg.norm(shape.uvs[shape.uv_indices[corner]] - wanted[corner])))
    # f32 rounds UVs up to 2 by 2^-24 of a tile, 6e-5 texels, in each of a few sums.
    assert most <= told["error"] + 1e-3 and most <= BOUND and told["folds"] == 0
    assert own > 4 * most, "less than what is redirected"


def test_weights_of_ones_own_drive_both_meshes(baked: Path) -> None:
    """A rig's weights, not those of the frames: linear in each."""
    stage = opened(baked / "out" / "basis.usdc")
    root = stage.GetDefaultPrim()
    weights = UsdSkel.Animation(root.GetChild("motion")).GetBlendShapeWeightsAttr()
    names = UsdSkel.Animation(root.GetChild("motion")).GetBlendShapesAttr().Get()
    own = np.linspace(0.25, 0.75, len(names))
    weights.Clear()
    weights.Set([0.0] * len(names), 1)
    weights.Set(own.tolist(), 2)
    expected = {}
    for name in ("mesh", "uvs"):
        prim = root.GetChild(name)
        points = np.array(UsdGeom.Mesh(prim).GetPointsAttr().Get()).astype(float)
        for child in prim.GetChildren():
            shape = UsdSkel.BlendShape(child)
            moved = np.array(shape.GetOffsetsAttr().Get()) * own[list(names).index(child.GetName())]
            np.add.at(points, np.array(shape.GetPointIndicesAttr().Get()), moved)
        expected[name] = points
    assert UsdSkel.BakeSkinning(UsdSkel.Root(root), Gf.Interval(1, 2))
    for name, points in expected.items():
        found = UsdGeom.Mesh(root.GetChild(name)).GetPointsAttr()
        np.testing.assert_allclose(found.Get(2), points, atol=1e-6)
        assert np.abs(np.array(found.Get(2)) - np.array(found.Get(1))).max() > 1e-3


def test_at_rest_it_is_the_mesh_and_the_second_one_is_not_rendered(baked: Path) -> None:
    stage = Usd.Stage.Open(str(baked / "out" / "basis.usdc"))
    shot = Usd.Stage.Open(str(baked / "scene" / "sheet.usda"))
    assert UsdGeom.GetStageUpAxis(stage) == UsdGeom.GetStageUpAxis(shot)
    assert UsdGeom.GetStageMetersPerUnit(stage) == UsdGeom.GetStageMetersPerUnit(shot)
    assert stage.GetTimeCodesPerSecond() == shot.GetTimeCodesPerSecond()
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (1, 4)
    root = stage.GetDefaultPrim()
    mesh, uvs = (UsdGeom.Mesh(root.GetChild(name)) for name in ("mesh", "uvs"))
    assert uvs.ComputePurpose() == "guide" and mesh.ComputePurpose() == "default"
    st = np.array(UsdGeom.PrimvarsAPI(mesh).GetPrimvar("st").Get())
    points = np.array(uvs.GetPointsAttr().Get())
    np.testing.assert_array_equal(points[:, :2], st)
    assert not points[:, 2].any() and st[:, 0].max() > 1, "both tiles, side by side"
    assert mesh.GetFaceVertexIndicesAttr().Get() == uvs.GetFaceVertexIndicesAttr().Get()


def test_names_of_controls_become_those_of_blend_shapes(tmp_path: Path) -> None:
    gentle(tmp_path, 3)
    (tmp_path / "controls.csv").write_text("frame,pull,left-arm\n1,1,0\n2,0,1\n3,1,1\n")
    bake(tmp_path, "--controls", tmp_path / "controls.csv")
    stage = Usd.Stage.Open(str(tmp_path / "out" / "basis.usdc"))
    motion = UsdSkel.Animation(stage.GetDefaultPrim().GetChild("motion"))
    assert list(motion.GetBlendShapesAttr().Get())[:3] == ["pull", "left_arm", "pull_left_arm"]
    np.testing.assert_array_equal(np.array(motion.GetBlendShapeWeightsAttr().Get(3))[:3], 1)
