"""Meshes of USD stages, as vrtm takes them, and the choice of their UV sets."""

import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdGeom

import scenes
from conftest import refused
from scenes import UVS, saved
from vrtm.bake.scene import Scene, SceneError, SceneOptions
from vrtm.bake.scene.topology import unique_names

FACE_VARYING = [UVS[vertex] for vertex in scenes.INDICES]


@pytest.fixture
def stage(tmp_path: Path) -> Usd.Stage:
    return scenes.stage(tmp_path / "a.usda")


def corner_uvs(shape) -> np.ndarray:
    """(corners, 2), NaN at corners without UVs."""
    found = np.full((len(shape.indices), 2), np.nan)
    found[shape.uv_indices >= 0] = shape.uvs[shape.uv_indices[shape.uv_indices >= 0]]
    return found


@pytest.mark.parametrize(
    ("values", "interpolation", "indices"),
    [
        (UVS, "vertex", None),
        (UVS, "varying", None),
        (UVS[::-1], "vertex", [5, 4, 3, 2, 1, 0]),
        (FACE_VARYING, "faceVarying", None),
        (UVS, "faceVarying", scenes.INDICES),
        ([(0, 1), (0.5, 0.5)], "uniform", None),
        ([(0.5, 0.5)], "constant", None),
    ],
)
def test_uvs_of_any_interpolation_are_those_of_corners(stage: Usd.Stage, values, interpolation, indices) -> None:
    mesh = scenes.mesh(stage, "/mesh", uvs=values, interpolation=interpolation, indices=indices)
    # Left-handed meshes keep the order of their corners.
    mesh.CreateOrientationAttr("leftHanded")
    expected = FACE_VARYING if len(values) > 2 else np.repeat(values, 8 // len(values), axis=0)
    with Scene(saved(stage)) as scene:
        (shape,) = scene.shapes
        assert np.array_equal(corner_uvs(shape), np.array(expected))
        assert np.array_equal(shape.indices, scenes.INDICES) and np.array_equal(shape.face_counts, [4, 4])
        assert np.array_equal(shape.rest, scenes.POINTS)
        assert shape.uv_indices.dtype == shape.indices.dtype == shape.face_counts.dtype == np.int32


def test_inherited_uvs(stage: Usd.Stage) -> None:
    group = UsdGeom.Xform.Define(stage, "/group").GetPrim()
    # Only constant primvars are inherited.
    scenes.primvar(group, "st", scenes.TYPES.TexCoord2fArray, [(0.25, 0.75)], "constant")
    scenes.mesh(stage, "/group/mesh", uvs=None)
    assert np.array_equal(corner_uvs(Scene(saved(stage)).shapes[0]), np.full((8, 2), (0.25, 0.75)))


@pytest.mark.parametrize(
    ("kind", "name", "third"),
    [("TexCoord3fArray", "map1", 0), ("TexCoord3dArray", "st", 1), ("Float3Array", "uv", 0), ("Half3Array", "st", 2)],
)
def test_uvs_of_three_numbers_are_u_and_v(stage: Usd.Stage, kind: str, name: str, third: int) -> None:
    mesh = scenes.mesh(stage, "/mesh", uvs=None)
    scenes.primvar(mesh.GetPrim(), name, getattr(scenes.TYPES, kind), [(u, v, third * v) for u, v in UVS], "vertex")
    scene = Scene(saved(stage))
    assert scene.shapes[0].uv_name == name and np.array_equal(corner_uvs(scene.shapes[0]), FACE_VARYING)
    told = ["/mesh: its UVs have three numbers, the third of which is left out"]
    assert scene.warnings == told[: third > 0]


def test_values_that_were_not_authored_and_holes_leave_faces_without_uvs(stage: Usd.Stage) -> None:
    values, indices = [(9, 9), *UVS], [1, 2, 5, 4, 0, 3, 6, 5]
    mesh = scenes.mesh(stage, "/mesh", uvs=values, interpolation="faceVarying", indices=indices)
    UsdGeom.PrimvarsAPI(mesh).GetPrimvar("st").SetUnauthoredValuesIndex(0)
    scene = Scene(saved(stage))
    assert scene.shapes[0].uv_indices.tolist() == [1, 2, 5, 4, -1, -1, -1, -1]
    assert scene.warnings == ["/mesh: 1 of its 2 faces are without UVs: nothing is baked there"]
    mesh.CreateHoleIndicesAttr([0])
    mesh.GetHoleIndicesAttr().Set([0])
    UsdGeom.PrimvarsAPI(mesh).GetPrimvar("st").SetUnauthoredValuesIndex(-1)
    scene = Scene(saved(stage))
    assert scene.shapes[0].uv_indices.tolist() == [-1, -1, -1, -1, 0, 3, 6, 5] and not scene.warnings


def test_which_uv_set(stage: Usd.Stage) -> None:
    mesh = scenes.mesh(stage, "/mesh", name="map1")
    assert Scene(saved(stage)).shapes[0].uv_name == "map1"
    scenes.primvar(mesh.GetPrim(), "st_redirected", scenes.TYPES.TexCoord2fArray, FACE_VARYING, "faceVarying")
    assert Scene(saved(stage)).shapes[0].uv_name == "map1", "an earlier bake's primvar is no UV set of the artist's"
    other = [(u / 2, v) for u, v in UVS]
    scenes.primvar(mesh.GetPrim(), "map2", scenes.TYPES.Float2Array, other, "vertex")
    assert Scene(saved(stage)).shapes[0].uv_name == "map1", "a primvar whose role is a texture coordinate comes first"
    shape = Scene(saved(stage), SceneOptions(uv=("map2",))).shapes[0]
    assert shape.uv_name == "map2" and shape.uvs[2].tolist() == [0.5, 0]
    scenes.primvar(mesh.GetPrim(), "map3", scenes.TYPES.TexCoord2fArray, other, "vertex")
    refused(SceneError, r"a\.usda /mesh: several UV sets \(map1, map3\)", Scene, saved(stage))
    scenes.primvar(mesh.GetPrim(), "st", scenes.TYPES.TexCoord2fArray, other, "vertex")
    assert Scene(saved(stage)).shapes[0].uv_name == "st"
    refused(SceneError, r"no mesh to bake.*/mesh has no UVs 'none'", Scene, saved(stage), SceneOptions(uv=("none",)))
    # What cannot be taken, or not without being named, is told.
    mesh.GetPrim().GetAttribute("primvars:st").SetTypeName(scenes.TYPES.Color3fArray)
    with pytest.raises(SceneError, match=r"/mesh has no UVs 'st': primvars:st is a color3f\[\]\)"):
        Scene(saved(stage), SceneOptions(uv=("st",)))
    bald = scenes.mesh(stage, "/bald", uvs=None)
    scenes.primvar(bald.GetPrim(), "map9", scenes.TYPES.Float3Array, [(u, v, 0) for u, v in UVS], "vertex")
    assert Scene(saved(stage), SceneOptions(meshes=("/bald",), uv=("map9",))).shapes[0].uv_name == "map9"
    with pytest.raises(SceneError, match="/bald: has no UVs, but map9 of three numbers, which --uv can name"):
        Scene(saved(stage), SceneOptions(meshes=("/bald",)))


def test_time_samples_and_frames(tmp_path: Path) -> None:
    stage = scenes.stage(tmp_path / "a.usda", 1.5, 4.2)
    scenes.stretch(scenes.mesh(stage, "/mesh"), [1, 3])
    scene = Scene(saved(stage))
    assert scene.frames == (2, 3, 4)
    assert scene.positions("mesh", 2)[2].tolist() == pytest.approx([2.1, 0, 0])
    assert scene.positions("mesh", 4)[2].tolist() == pytest.approx([2.2, 0, 0])
    assert scene.shapes[0].rest[2].tolist() == pytest.approx([2.1, 0, 0]), "the first frame"
    still = scenes.stage(tmp_path / "c.usda", None)
    scenes.mesh(still, "/mesh")
    assert Scene(saved(still)).frames == (1,) and scene.warnings == Scene(saved(still)).warnings == []


def test_frames_that_cannot_be_meant_are_told(tmp_path: Path) -> None:
    between = scenes.stage(tmp_path / "a.usda", None)
    scenes.stretch(scenes.mesh(between, "/mesh"), [0.25, 0.5, 0.75])
    scene = Scene(saved(between))
    assert scene.frames == (0,)
    assert scene.warnings == [f"{scene.path}: no frame from 0.25 to 0.75 is whole: frame 0 alone is baked"]
    assert [(entry.frames, entry.meant) for entry in scene.left_out] == [((0.25, 0.75), True)]
    between.SetStartTimeCode(-0.5)
    between.SetEndTimeCode(2)
    scene = Scene(saved(between))
    assert scene.frames == (0, 1, 2) and scene.warnings == [] and scene.left_out[0].frames == (-0.5,)
    backwards = scenes.stage(tmp_path / "b.usda", 10, 2)
    scenes.stretch(scenes.mesh(backwards, "/mesh"), [3, 5])
    scene = Scene(saved(backwards))
    assert scene.frames == (3, 4, 5)
    assert scene.warnings == [f"{scene.path}: its start time code, 10, is after its end, 2: its time samples count"]


def test_hidden_meshes_are_left_out(stage: Usd.Stage) -> None:
    scenes.mesh(stage, "/shown")
    scenes.mesh(stage, "/group/guide").CreatePurposeAttr("guide")
    UsdGeom.Xform.Define(stage, "/proxies").CreatePurposeAttr("proxy")
    scenes.mesh(stage, "/proxies/proxy")
    UsdGeom.Xform.Define(stage, "/off").MakeInvisible()
    scenes.mesh(stage, "/off/hidden")
    blinking = scenes.mesh(stage, "/blinking").CreateVisibilityAttr()
    blinking.Set("invisible", 1)
    blinking.Set("inherited", 3)
    scenes.mesh(stage, "/inactive").GetPrim().SetActive(False)
    stage.CreateClassPrim("/_class")
    scenes.mesh(stage, "/_class/abstract")
    scenes.mesh(stage, "/render").CreatePurposeAttr("render")
    path = saved(stage)
    scene = Scene(path)
    assert [shape.name for shape in scene.shapes] == ["shown", "blinking", "render"]
    assert {entry.mesh: entry.why for entry in scene.left_out if entry.meant} == {
        "/group/guide": "has the purpose 'guide'",
        "/proxies/proxy": "has the purpose 'proxy'",
        "/off/hidden": "is invisible in all frames",
    }
    refused(SceneError, "/off/hidden: is invisible in all frames", Scene, path, SceneOptions(meshes=("/off/hidden",)))
    refused(SceneError, r"no mesh to bake.*has the purpose 'guide'", Scene, path, SceneOptions(meshes=("/group/*",)))


def test_choice_of_meshes_and_names(stage: Usd.Stage) -> None:
    for path in ("/a/body", "/b/body", "/b/Hat", "/b/hat", "/b/bald"):
        scenes.mesh(stage, path, uvs=None if path == "/b/bald" else UVS)
    path = saved(stage)
    assert [shape.name for shape in Scene(path).shapes] == ["a_body", "b_body", "b_Hat", "b_hat_2"]
    for wanted, found in {
        "/b": ["/b/body", "/b/Hat", "/b/hat"],
        "body": ["/a/body", "/b/body"],
        "/*/h*": ["/b/hat"],
    }.items():
        assert [shape.path for shape in Scene(path, SceneOptions(meshes=(wanted,))).shapes] == found
    for wanted, message in {"/b/bald": "/b/bald: has no UVs", "/c": "'/c' is no mesh of the scene"}.items():
        refused(SceneError, message, Scene, path, SceneOptions(meshes=("body", wanted)))
    stage.DefinePrim("/light", "SphereLight")
    refused(SceneError, "'/light' is a SphereLight, not a mesh", Scene, saved(stage), SceneOptions(meshes=("/light",)))
    scene = Scene(path, SceneOptions(meshes=("/b",)))
    assert [(entry.mesh, entry.why) for entry in scene.left_out] == [
        ("/a/body", "not named by --meshes"),
        ("/b/bald", "has no UVs"),
    ]
    # What does not deform would get no maps anyway.
    assert all(entry.meant for entry in scene.left_out)
    scenes.stretch(UsdGeom.Mesh(stage.GetPrimAtPath("/b/bald")), [1, 2])
    assert [entry.mesh for entry in Scene(saved(stage)).left_out if not entry.meant] == ["/b/bald"]


def test_names_differ_in_more_than_the_case_of_letters() -> None:
    assert unique_names(["/a/hat", "/b/coat"]) == ["hat", "coat"]
    found = unique_names(["/a/hat", "/A/Hat", "/a_hat", "/b/sk\u00f6n:x"])
    assert found == ["a_hat", "A_Hat_2", "a_hat_3", "sk\u00f6n_x"]
    # Letters and their marks in any script; what a file system may take for one name is told.
    for name in ("\u76ae\u819a", "\u091a\u092e\u0921\u093c\u0940", "u\u0308ber", "_x-1"):
        assert unique_names([f"/a/{name}"]) == [name]
    warnings: list[str] = []
    names = unique_names(["/a/b", "/a_b", "/c/b", "/\u00fc", "/u\u0308"], warnings)
    assert names == ["a_b", "a_b_2", "c_b", "\u00fc", "u\u0308_2"]
    assert warnings[0] == "/a_b: <mesh> stands for a_b_2, since it stands for a_b of /a/b" and len(warnings) == 2
    # Of long ones the end, which tells more of a path, and whole letters.
    (first, second, third), short = unique_names([f"/{c * 300}" for c in "xx\u5b57"], warnings), "x" * 160
    assert (first, second, third) == (short, f"{short}_2", "\u5b57" * 53)
    assert warnings[2] == f"/{'x' * 300}: <mesh> stands for {short}, since its name is too long"


def test_instances_in_the_same_pose_are_one_shape(stage: Usd.Stage) -> None:
    scenes.stretch(scenes.mesh(stage, "/asset/mesh"), [1, 5])
    for name in ("one", "two"):
        scenes.instance(stage, f"/{name}", "/asset")
    stage.GetPrimAtPath("/asset").SetSpecifier(Sdf.SpecifierClass)
    scene = Scene(saved(stage))
    assert [(shape.path, shape.instances) for shape in scene.shapes] == [("/one/mesh", ("/one/mesh", "/two/mesh"))]
    assert scene.positions("mesh", 5)[2].tolist() == pytest.approx([2.4, 0, 0])


@pytest.mark.parametrize("specifier", [Sdf.SpecifierDef, Sdf.SpecifierOver, Sdf.SpecifierClass])
def test_prototypes_of_point_instancers_are_shapes(stage: Usd.Stage, specifier: Sdf.Specifier) -> None:
    # A prototype of two instancers, one of which is a prototype itself.
    scenes.stretch(scenes.mesh(stage, "/many/prototypes/group/stud"), [2, 4])
    for path, target in (("/many", "group"), ("/more", "inner"), ("/many/prototypes/inner", "group/stud")):
        instancer = UsdGeom.PointInstancer.Define(stage, path)
        instancer.CreatePrototypesRel().SetTargets([f"/many/prototypes/{target}"])
        instancer.CreateProtoIndicesAttr([0, 0])
        instancer.CreatePositionsAttr([(0, 0, 0), (3, 0, 0)])
    stage.GetPrimAtPath("/many/prototypes").SetSpecifier(specifier)
    stage.ClearMetadata("startTimeCode")
    stage.ClearMetadata("endTimeCode")
    scene = Scene(saved(stage))
    assert [shape.path for shape in scene.shapes] == ["/many/prototypes/group/stud"] and scene.frames == (2, 3, 4)


def test_variants(stage: Usd.Stage) -> None:
    model = UsdGeom.Xform.Define(stage, "/model").GetPrim()
    shapes = model.GetVariantSets().AddVariantSet("shape")
    for name, width in (("slim", 1), ("wide", 3)):
        shapes.AddVariant(name)
        shapes.SetVariantSelection(name)
        with shapes.GetVariantEditContext():
            scenes.mesh(stage, "/model/mesh", [(x * width, y, z) for x, y, z in scenes.POINTS])
    shapes.SetVariantSelection("slim")
    path = saved(stage)
    before = Path(path).read_bytes()
    for name, width in (("slim", 2), ("wide", 6)):
        options = SceneOptions(variants=(("/model", "shape", name),))
        assert Scene(path, pickle.loads(pickle.dumps(options))).shapes[0].rest[2, 0] == width
    assert Scene(path).shapes[0].rest[2, 0] == 2 and Path(path).read_bytes() == before
    for wrong, message in {
        ("/model", "shape", "tall"): r"no variant 'tall' of 'shape' among \['slim', 'wide'\]",
        ("/model", "look", "x"): r"no variant set 'look' among \['shape'\]",
        ("/none", "shape", "slim"): "there is no prim /none",
    }.items():
        refused(SceneError, message, Scene, path, SceneOptions(variants=(wrong,)))


def test_rest(stage: Usd.Stage, tmp_path: Path) -> None:
    mesh = scenes.mesh(stage, "/mesh")
    scenes.stretch(mesh, [1, 5])
    path = saved(stage)

    def right(rest: str | None) -> float:
        return Scene(path, SceneOptions(rest=rest)).shapes[0].rest[2, 0]

    assert right(None) == right("first") == 2
    assert right("frame:3") == pytest.approx(2.2) and right("frame:2.5") == pytest.approx(2.15)
    other = scenes.stage(tmp_path / "rest.usda")
    scenes.mesh(other, "/group/mesh", [(x * 5, y, z) for x, y, z in scenes.POINTS])
    scenes.mesh(other, "/group/more")
    assert right(saved(other)) == 10, "by the name of the mesh"
    (tmp_path / "rest.obj").write_text(
        "".join(f"v {x * 7} {y} {z}\n" for x, y, z in scenes.POINTS) + "f 1 2 5 4\nf 3 6 5 2\n"
    )
    assert right(str(tmp_path / "rest.obj")) == 14
    (tmp_path / "wrong.obj").write_text("v 0 0 0\n" * 6 + "f 1 2 5 4\nf 2 3 5 6\n")
    for rest, message in {
        "bind": "/mesh: not bound to a skeleton",
        "pref": "/mesh: none of primvars:Pref",
        "frame:x": "'frame:x'",
        str(
            tmp_path / "wrong.obj"
        ): r"wrong\.obj: face 2 has the vertices 1 2 4 5, but that of the rest mesh has 1 2 5 4",
        str(tmp_path / "none.obj"): r"none\.obj: no such file",
        str(tmp_path / "none.usd"): r"none\.usd",
    }.items():
        refused(SceneError, message, right, rest)
    pref = [(x * 3, y, z) for x, y, z in scenes.POINTS]
    scenes.primvar(mesh.GetPrim(), "Pref", scenes.TYPES.Point3fArray, pref, "vertex")
    saved(stage)
    assert right(None) == right("pref") == 6 and right("first") == 2


def test_values_per_vertex(stage: Usd.Stage) -> None:
    prim = scenes.mesh(stage, "/mesh").GetPrim()
    plain, colour = scenes.TYPES.FloatArray, scenes.TYPES.Color3fArray
    scenes.primvar(prim, "vertices", plain, [0, 0.5, 1], "vertex", [0, 1, 2, 2, 1, 0])
    scenes.primvar(prim, "all", plain, [0.25], "constant")
    scenes.primvar(prim, "faces", plain, [0, 1], "uniform")
    corners = scenes.primvar(prim, "corners", plain, [0, 0, 0, 0, 1, 1, 1, 0], "faceVarying")
    for time in (1, 5):
        corners.Set(corners.Get(), time)
    scenes.primvar(prim, "displayColor", colour, [(0.5, 0.5, 0.5), (1, 0, 0), *[(1, 1, 1)] * 4], "vertex")
    scenes.primvar(prim, "few", plain, [1, 2], "vertex")
    scenes.primvar(prim, "words", scenes.TYPES.StringArray, ["a"] * 6, "vertex")
    # Indices of other integers, two of which name no value, and values that change.
    scenes.primvar(prim, "some", plain, [0.25, 1], "vertex").GetAttr().Set([0.5, 1], 1)
    prim.GetAttribute("primvars:some").Set([0.75, 1], 2)
    prim.CreateAttribute("primvars:some:indices", scenes.TYPES.Int64Array).Set([0, -1, 1, 1, 0, -1])
    prim.CreateAttribute("primvars:few:indices", scenes.TYPES.UIntArray).Set([0, 1, 2, 0, 0, 0])
    pref = scenes.primvar(prim, "Pref", scenes.TYPES.Point3fArray, scenes.POINTS, "vertex", [0, 1, 2, 3, 4, -1])
    refused(SceneError, "primvars:Pref has no value in 1 places", Scene, saved(stage))
    pref.GetAttr().Block()
    path = saved(stage)
    for option, value in (("rigidity", 0), ("mask", 1)):
        scene = Scene(path, SceneOptions(**{f"{option}_primvar": "some"}))
        assert getattr(scene.shapes[0], f"vertex_{option}").tolist() == [0.5, value, 1, 1, 0.5, value]
        assert scene.warnings == [
            "/mesh: primvars:some changes over time; it is read at time code 1",
            f"/mesh: primvars:some has no value in 2 of 6 places: {value} is taken there",
        ]
    for name, expected in {
        "vertices": [0, 0.5, 1, 1, 0.5, 0],
        "primvars:all": [0.25] * 6,
        "faces": [0, 0.5, 1, 0, 0.5, 1],
        "corners": [0, 0.5, 1, 0, 0, 1],
        "displayColor": [0.5, 0.2126, 1, 1, 1, 1],
    }.items():
        scene = Scene(path, SceneOptions(rigidity_primvar=name, mask_primvar="vertices"))
        (shape,) = scene.shapes
        assert not scene.warnings
        assert shape.vertex_rigidity.tolist() == pytest.approx(expected), name
        assert shape.vertex_rigidity.dtype == np.float32 and shape.vertex_mask[2] == 1
    for name, message in {
        "few": "primvars:few:indices has 2, but there are 2 values",
        "words": r"primvars:words is a string\[\], not numbers",
        "none": "no mesh has the primvar 'none' for the rigidity",
    }.items():
        refused(SceneError, message, Scene, path, SceneOptions(rigidity_primvar=name))


def test_bad_input_is_named(tmp_path: Path) -> None:
    (tmp_path / "a.fbx").write_text("")
    scenes.saved(scenes.stage(tmp_path / "empty.usda"))
    for name, message in {
        "none.usda": r"none\.usda: no such file",
        "a.fbx": r"a\.fbx: '\.fbx' is none of",
        "empty.usda": r"empty\.usda: no mesh to bake \(the scene has none\)",
    }.items():
        refused(SceneError, message, Scene, tmp_path / name)
    wrongs = {
        "few_corners": ({"faces": scenes.INDICES[:7]}, "the faces have 8 corners, but 7 vertices are listed"),
        "no_vertex": ({"faces": [*scenes.INDICES[:7], 6]}, "corner 7 names the vertex 6, but there are 6"),
        "no_uv": (
            {"interpolation": "faceVarying", "indices": [0, 1, 2, 3, 4, 5, 6, 0]},
            "has 6, but there are 6 values",
        ),
    }
    for name, (change, message) in wrongs.items():
        stage = scenes.stage(tmp_path / f"{name}.usda")
        scenes.mesh(stage, "/mesh", **change)
        refused(SceneError, f"{name}.usda /mesh: .*{message}", Scene, saved(stage))


def test_topology_that_changes_is_named_with_its_time_code(stage: Usd.Stage, tmp_path: Path) -> None:
    mesh = scenes.mesh(stage, "/mesh")
    faces = mesh.GetFaceVertexIndicesAttr()
    faces.Set(scenes.INDICES, 1)
    faces.Set([1, 4, 3, 0, 1, 2, 5, 4], 2)  # the first face begins elsewhere
    faces.Set([0, 1, 4, 3, 2, 5, 1, 4], 3)
    scene = Scene(saved(stage))
    assert len(scene.positions("mesh", 2)) == 6
    told = r"a\.usda /mesh: time code 3: the topology changes: face 2 has the vertices 2 5 1 4"
    refused(SceneError, told, scene.positions, "mesh", 3)
    stage = scenes.stage(tmp_path / "b.usda")
    points = scenes.mesh(stage, "/mesh").GetPointsAttr()
    points.Set(scenes.POINTS, 1)
    points.Set([*scenes.POINTS, (9, 9, 9)], 2)
    with pytest.raises(SceneError, match=r"b\.usda /mesh: time code 2 has 7 points, but the first frame has 6"):
        Scene(saved(stage)).positions("mesh", 2)


BAKE = SceneOptions(lenient=True)


def uv_set(prim: UsdGeom.Mesh, name: str) -> None:
    scenes.primvar(prim.GetPrim(), name, scenes.TYPES.TexCoord2fArray, UVS, "vertex")


def chosen(path: Path, *names: str) -> dict[str, str]:
    return {shape.path: shape.uv_name for shape in Scene(path, SceneOptions(uv=names)).shapes}


def test_each_mesh_takes_the_first_uv_set_that_it_has(tmp_path: Path) -> None:
    path = tmp_path / "a.usda"
    stage = scenes.stage(path)
    body, jacket = scenes.mesh(stage, "/body"), scenes.mesh(stage, "/jacket", name="UVMap")
    uv_set(jacket, "lightmap")
    for prim in (body, jacket):
        scenes.stretch(prim, (1, 2, 3))
    stage.Save()
    refused(SceneError, r"/jacket: several UV sets \(UVMap, lightmap\).* --uv UVMap st", Scene, path, BAKE)
    assert chosen(path, "UVMap", "st") == chosen(path, "st", "none", "UVMap") == {"/body": "st", "/jacket": "UVMap"}
    assert chosen(path, "lightmap", "UVMap", "st") == {"/body": "st", "/jacket": "lightmap"}
    # Those that have none of them are named, with what they have.
    scene = Scene(path, SceneOptions(uv=("UVMap", "UVMap2"), lenient=True))
    assert [shape.path for shape in scene.shapes] == ["/jacket"]
    (entry,) = scene.left_out
    assert (entry.mesh, entry.meant) == ("/body", False) and entry.why == "has no UVs 'UVMap' or 'UVMap2', but st"
    # The jacket alone is asked for.
    uv_set(jacket, "st")
    stage.Save()
    assert chosen(path, "UVMap", "st") == {"/body": "st", "/jacket": "UVMap"}
    assert {shape.uv_name for shape in Scene(path, BAKE).shapes} == {"st"}


def test_a_mesh_that_cannot_be_read_does_not_end_a_bake(tmp_path: Path) -> None:
    path = tmp_path / "a.usda"
    stage = scenes.stage(path)
    prop = scenes.mesh(stage, "/prop", name="UVMap")
    uv_set(prop, "lightmap")
    # As many UVs as a mesh of other faces has, and a mesh that the file with the rest lacks.
    scenes.mesh(stage, "/broken", uvs=UVS[:3])
    for mesh in ("/body", "/hat"):
        scenes.stretch(scenes.mesh(stage, mesh), (1, 2, 3))
    stage.Save()
    rest = scenes.stage(tmp_path / "rest.usda")
    scenes.mesh(rest, "/body")
    scenes.mesh(rest, "/coat")
    for options in (BAKE, replace(BAKE, rest=saved(rest))):
        scene = Scene(path, options)
        assert [shape.path for shape in scene.shapes] == ["/body", "/hat"][: 1 if options.rest else 2]
        told = {entry.mesh: (entry.why, entry.meant) for entry in scene.left_out}
        assert told["/prop"] == ("nothing deforms there, and it has several UV sets", True)
        assert told["/broken"] == ("cannot be read: primvars:st has 3 values of interpolation vertex, not 6", False)
    assert "no meshes have the name of /hat" in told["/hat"][0] and not told["/hat"][1]
    # What --exclude names is not looked at, and a name without a mesh is told.
    scene = Scene(path, replace(BAKE, exclude=("bro*", "/hat", "/prop", "bodi")))
    assert [(entry.why, entry.meant) for entry in scene.left_out] == [("named by --exclude", True)] * 3
    assert scene.warnings == [f"--exclude: {path}: 'bodi' is no mesh of the scene: did you mean body?"]
    # But where it is named, or a pose is not the rest.
    refused(SceneError, "/prop: several UV sets", Scene, path, SceneOptions(lenient=True, meshes=("prop",)))
    with pytest.raises(SceneError, match="/broken: primvars:st has 3 values"):
        Scene(path, SceneOptions(lenient=True, meshes=("/body", "/broken")))
    refused(SceneError, "/prop: several UV sets", Scene, path)
    moved = [(2 * x, y, z) for x, y, z in scenes.POINTS]
    scenes.primvar(prop.GetPrim(), "Pref", scenes.TYPES.Point3fArray, moved, "vertex")
    stage.Save()
    refused(SceneError, "/prop: several UV sets", Scene, path, BAKE)
