"""Skinned and blend-shaped meshes, against closed forms."""

from pathlib import Path

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdSkel

import scenes
from bake_scenes import opened
from conftest import refused
from scenes import saved
from vrtm.bake.failure import Failure
from vrtm.bake.scene import Scene, SceneError, SceneOptions


@pytest.fixture
def arm(tmp_path: Path) -> Usd.Stage:
    return scenes.arm(tmp_path / "arm.usda")


@pytest.mark.parametrize("specifier", [Sdf.SpecifierDef, Sdf.SpecifierOver])
@pytest.mark.parametrize("frame", [1, 3, 5.5, 7, 10])
def test_joints_and_blend_shapes_with_an_in_between(arm: Usd.Stage, frame: float, specifier: Sdf.Specifier) -> None:
    # Also as a prototype, which an over keeps out of the stage.
    UsdGeom.PointInstancer.Define(arm, "/many").CreatePrototypesRel().SetTargets(["/arm"])
    arm.GetPrimAtPath("/arm").SetSpecifier(specifier)
    scene = Scene(saved(arm))
    # Animations are interpolated along the arc between two frames, weights linearly.
    assert scene.positions("skin", frame) == pytest.approx(scenes.arm_at((frame - 1) / 9), abs=1e-5)


def test_rest_is_the_bind_pose_in_the_skeletons_space(arm: Usd.Stage) -> None:
    path = saved(arm)
    for rest in (None, "bind"):
        assert Scene(path, SceneOptions(rest=rest)).shapes[0].rest == pytest.approx(np.array(scenes.POINTS, float))
    assert Scene(path, SceneOptions(rest="frame:10")).shapes[0].rest == pytest.approx(scenes.arm_at(1), abs=1e-5)
    pref = [(2 * x + 10, y, z) for x, y, z in scenes.POINTS]
    scenes.primvar(arm.GetPrimAtPath("/arm/skin"), "Pref", scenes.TYPES.Point3fArray, pref, "vertex")
    rest = Scene(saved(arm)).shapes[0].rest
    assert rest[5].tolist() == pytest.approx([4, 1, 0]), "the bind transform applies to Pref, too"


def test_a_skeleton_without_animation_is_in_its_rest_pose(arm: Usd.Stage) -> None:
    skeleton = UsdSkel.Skeleton(arm.GetPrimAtPath("/arm/skeleton"))
    UsdSkel.BindingAPI(skeleton.GetPrim()).GetAnimationSourceRel().ClearTargets(True)
    skeleton.GetRestTransformsAttr().Set([Gf.Matrix4d(1), Gf.Matrix4d().SetTranslate((1, 2, 0))])
    scene = Scene(saved(arm))
    assert scene.positions("skin", 5)[5].tolist() == pytest.approx([2, 3, 0])
    assert scene.shapes[0].rest[5].tolist() == [2, 1, 0]


def test_blend_shapes_without_joints(arm: Usd.Stage) -> None:
    for name in ("skel:jointIndices", "skel:jointWeights"):
        arm.GetPrimAtPath("/arm/skin").RemoveProperty(f"primvars:{name}")
    scene = Scene(saved(arm))
    expected = np.add(scenes.POINTS, (10.0, 0, 0))
    assert scene.shapes[0].rest == pytest.approx(expected)
    expected[5, 2] = 3
    assert scene.positions("skin", 5.5) == pytest.approx(expected)


def test_instances_are_one_shape_if_one_animation_moves_them(arm: Usd.Stage, tmp_path: Path) -> None:
    shot = scenes.stage(tmp_path / "shot.usda", 1, 10)
    saved(arm)
    for name in ("one", "two", "still"):
        UsdSkel.Root.Define(shot, f"/{name}")
        scenes.instance(shot, f"/{name}/arm", "/arm", "arm.usda")
    scene = Scene(saved(shot))
    assert [shape.instances for shape in scene.shapes] == [("/one/arm/skin", "/two/arm/skin", "/still/arm/skin")]
    assert scene.positions(scene.shapes[0], 10) == pytest.approx(scenes.arm_at(1), abs=1e-5)


def test_instances_with_animations_of_their_own_are_shapes_of_their_own(arm: Usd.Stage, tmp_path: Path) -> None:
    # The animation comes from above the instance.
    UsdSkel.BindingAPI(arm.GetPrimAtPath("/arm/skeleton")).GetAnimationSourceRel().ClearTargets(True)
    arm.GetPrimAtPath("/arm/skeleton").RemoveProperty("skel:animationSource")
    saved(arm)
    shot = scenes.stage(tmp_path / "shot.usda", 1, 10)
    for name, angle in (("one", 0), ("two", 90), ("three", 90)):
        root = UsdSkel.Root.Define(shot, f"/{name}")
        animation = UsdSkel.Animation.Define(shot, f"/{'two' if angle else name}/animation")
        animation.CreateJointsAttr(["upper/lower"])
        animation.CreateTranslationsAttr([(1, 0, 0)])
        animation.CreateRotationsAttr([Gf.Quatf(Gf.Rotation((0, 0, 1), angle).GetQuat())])
        animation.CreateScalesAttr([Gf.Vec3h(1, 1, 1)])
        UsdSkel.BindingAPI.Apply(root.GetPrim()).CreateAnimationSourceRel().SetTargets([animation.GetPath()])
        scenes.instance(shot, f"/{name}/arm", "/arm", "arm.usda")
    scene = Scene(saved(shot))
    assert [shape.instances for shape in scene.shapes] == [("/one/arm/skin",), ("/two/arm/skin", "/three/arm/skin")]
    assert scene.positions("one_arm_skin", 1)[2].tolist() == pytest.approx([2, 0, 0])
    assert scene.positions("two_arm_skin", 1)[2].tolist() == pytest.approx([1, 1, 0], abs=1e-5)


def test_a_binding_that_cannot_pose_is_an_error(arm: Usd.Stage) -> None:
    UsdSkel.BindingAPI(arm.GetPrimAtPath("/arm/skin")).GetJointIndicesPrimvar().Set([0, 0, 7, 0, 0, 1])
    with pytest.raises(SceneError, match="/arm/skin"):
        Scene(saved(arm)).positions("skin", 2)


@pytest.mark.parametrize(
    ("odd", "named", "why"),
    [
        ("/arm", "/arm/skin has skel:skeleton", "it is not below a SkelRoot"),
        ("/arm/skin", "/arm/skin has skel:skeleton", "the API SkelBindingAPI is not applied to it"),
        ("/arm/skeleton", "/arm/skeleton has skel:animationSource", "the API SkelBindingAPI is not applied to it"),
    ],
)
def test_a_skeleton_that_moves_nothing_is_told(arm: Usd.Stage, odd: str, named: str, why: str) -> None:
    arm.GetPrimAtPath(odd).RemoveAPI(UsdSkel.BindingAPI)
    arm.GetPrimAtPath("/arm").SetTypeName("SkelRoot" if odd != "/arm" else "Xform")
    told = f"/arm/skin: no skeleton moves it: {named}, which is ignored, since {why}"
    assert Scene(saved(arm)).warnings == [told]
    # The error that nothing is to be baked has the reason.
    refused(Failure, f"nothing deforms: .*; {told}$", opened, Path(saved(arm)), rigidity="none.png")


def test_meshes_beside_a_skinned_one(arm: Usd.Stage) -> None:
    scenes.stretch(scenes.mesh(arm, "/arm/prop"), [1, 5])
    scene = Scene(saved(arm))
    assert [shape.name for shape in scene.shapes] == ["skin", "prop"]
    assert scene.positions("prop", 5)[2].tolist() == pytest.approx([2.4, 0, 0])
