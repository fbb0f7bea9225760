"""Alembic archives, written by the same wheel that reads them."""

import sys
from pathlib import Path

import imath
import numpy as np
import pytest
from alembic3d import Abc, AbcCoreAbstract, AbcGeom

import alembic_scenes as abc
from conftest import refused
from scenes import POINTS, UVS
from vrtm.bake.scene import Scene, SceneError, SceneOptions

FACES = [0, 3, 4, 1, 1, 4, 5, 2]


def write(
    path: Path, samples=3, start=1.0, extra=None, fps=24, shutter=(0,), cyclic=True, hint=None, **mesh: object
) -> str:
    """A mesh /group/mesh whose right edge moves by 0.1 per sample, at so many frames per second. `shutter`: samples
    around each frame. `mesh`: arguments of `alembic_scenes.mesh`."""
    archive = Abc.CreateArchiveWithInfo(str(path), hint, "test", "") if hint else Abc.OArchive(str(path))
    if shutter == (0,):
        times = abc.sampled(archive, start, fps)
    else:
        kept = AbcCoreAbstract.TimeVector()
        for number in range(len(shutter) if cyclic else samples):
            frame, offset = divmod(number, len(shutter))
            kept.append((start + frame + shutter[offset]) / fps)
        kind = (len(shutter), 1 / fps) if cyclic else (AbcCoreAbstract.AcyclicFlag.kAcyclic,)
        sampling = AbcCoreAbstract.TimeSampling(AbcCoreAbstract.TimeSamplingType(*kind), kept)
        times = archive.addTimeSampling(sampling)
    poses = [[(x + 0.1 * number * (x == 2), y, z) for x, y, z in POINTS] for number in range(samples)]
    group = AbcGeom.OXform(archive.getTop(), "group")
    given = {"uvs": UVS, "indices": FACES, "scope": AbcGeom.GeometryScope.kFacevaryingScope} | mesh
    made = abc.mesh(group, "mesh", poses, FACES, times, **given)
    if extra:
        extra(made.getSchema())
    return str(path)


@pytest.mark.parametrize("subd", [False, True])
def test_faces_uvs_and_frames(tmp_path: Path, subd: bool) -> None:
    scene = Scene(write(tmp_path / "a.abc", subd=subd))
    (shape,) = scene.shapes
    assert (shape.name, shape.path, shape.uv_name) == ("mesh", "/group/mesh", "uv")
    assert shape.indices.tolist() == shape.uv_indices.tolist() == FACES and shape.face_counts.tolist() == [4, 4]
    assert shape.uvs.tolist() == [list(uv) for uv in UVS] and shape.rest.tolist() == [list(p) for p in POINTS]
    assert scene.frames == (1, 2, 3) and shape.scheme == ("catmullClark" if subd else "") and shape.left_handed
    for frame, x in ((0, 2), (1, 2), (2, 2.1), (2.5, 2.15), (3, 2.2), (9, 2.2)):
        assert scene.positions(shape, frame)[2, 0] == pytest.approx(x)


def test_frames_per_second(tmp_path: Path) -> None:
    path = write(tmp_path / "a.abc", samples=5, start=24)
    scene = Scene(path, SceneOptions(fps=48))
    assert scene.frames == tuple(range(48, 57)) and scene.positions("mesh", 49)[2, 0] == pytest.approx(2.05)
    assert Scene(path, SceneOptions(fps=12)).frames == (12, 13, 14)
    refused(SceneError, "0 frames per second", Scene, path, SceneOptions(fps=0))


@pytest.mark.parametrize("fps", [23.976, 25, 30, 60, 12])
def test_the_rate_is_the_files_own(tmp_path: Path, fps: float) -> None:
    scene = Scene(write(tmp_path / "a.abc", samples=6, start=1001, fps=fps))
    assert scene.frames == tuple(range(1001, 1007)) and scene.rate == f"{fps:g} per second, as the file has"
    assert scene.positions("mesh", 1006)[2, 0] == pytest.approx(2.5)
    # Twelve may be every second of 24.
    told = [("12 samples per second are taken for 12 frames" in warning) for warning in scene.warnings]
    assert told == [True] * (fps == 12)
    other = Scene(write(tmp_path / "a.abc", samples=6, start=1001, fps=fps), SceneOptions(fps=17))
    assert f"/group/mesh: it has {fps:.4g} samples per second, but there are 17 frames" in other.rate


@pytest.mark.parametrize("cyclic", [True, False])
@pytest.mark.parametrize("shutter", [(-0.25, 0, 0.25), (-0.25, 0.25), (0, 0.5), (0, 0.2)])
def test_samples_for_motion_blur_are_no_other_rate(tmp_path: Path, shutter, cyclic: bool) -> None:
    options = {"samples": 6 * len(shutter), "start": 1001, "shutter": shutter, "cyclic": cyclic}
    scene = Scene(write(tmp_path / "a.abc", fps=25, **options))
    # Evenly spaced, they may be frames, too.
    guessed = (
        [] if cyclic or shutter not in ((0, 0.5), (-0.25, 0.25)) else ["50 samples per second are taken for 25 frames"]
    )
    assert scene.frames == tuple(range(1001, 1007)) and len(scene.warnings) == len(guessed)
    assert all(told in warning for told, warning in zip(guessed, scene.warnings))
    # Of a program that says its rate there is no doubt.
    scene = Scene(write(tmp_path / "b.abc", fps=25, hint=25.0, **options))
    assert scene.frames == tuple(range(1001, 1007)) and not scene.warnings and scene.clock.frames == 25


def test_transforms_have_frames_with_world_alone(tmp_path: Path) -> None:
    archive = Abc.OArchive(str(tmp_path / "a.abc"))
    scales = [np.diag([scale, 1.0, 1.0, 1.0]) for scale in (1, 2, 3)]
    above = abc.placed(archive.getTop(), "above", scales, abc.sampled(archive, 30, 30))
    mesh = abc.mesh(above, "mesh", [POINTS], FACES, uvs=UVS)
    del mesh, above, archive
    assert Scene(tmp_path / "a.abc").frames == (1,)
    scene = Scene(tmp_path / "a.abc", SceneOptions(world=True))
    assert scene.frames == (30, 31, 32) and not scene.warnings and not scene.shapes[0].still
    assert [scene.positions("mesh", frame)[2, 0] for frame in scene.frames] == [2, 4, 6]


def test_samples_between_frames_are_told(tmp_path: Path) -> None:
    scene = Scene(write(tmp_path / "a.abc", samples=8, start=10.5), SceneOptions(fps=24))
    told = "; /group/mesh: at 24 per second, samples lie between frames, such as at 10.5"
    assert scene.rate == f"24 per second{told}" and not scene.warnings, "a rate that is asked for"
    assert Scene(tmp_path / "a.abc").warnings == [told[2:]]
    many = Scene(write(tmp_path / "b.abc", samples=24, start=4004, fps=96))
    assert many.frames == tuple(range(1001, 1007))
    assert many.warnings == ["/group/mesh: its 96 samples per second are taken for 24 frames: --fps says otherwise"]


def test_uvs_per_vertex_and_per_corner(tmp_path: Path) -> None:
    shape = Scene(write(tmp_path / "a.abc", indices=None, scope=abc.VERTEX)).shapes[0]
    assert shape.uv_indices.tolist() == FACES
    corners = [UVS[vertex] for vertex in FACES]
    shape = Scene(write(tmp_path / "b.abc", uvs=corners, indices=None)).shapes[0]
    assert shape.uvs[shape.uv_indices].tolist() == [list(uv) for uv in corners]
    told = r"c\.abc /group/mesh: the UV set uv has 6 values of interpolation faceVarying, not 8"
    refused(SceneError, told, Scene, write(tmp_path / "c.abc", indices=None))


def parameter(schema, kind: str, name: str, values, indices=()) -> None:
    """Gives a mesh a parameter with a value per vertex, by indices if there are some."""
    made = getattr(AbcGeom, f"O{kind}GeomParam")(schema.getArbGeomParams(), name, bool(indices), abc.VERTEX, 1)
    chosen = (abc.array(imath.UnsignedIntArray, indices),) if indices else ()
    made.set(getattr(AbcGeom, f"O{kind}GeomParamSample")(values, *chosen, abc.VERTEX))


@pytest.mark.parametrize(("kind", "name"), [("V3f", "uv"), ("P3f", "st"), ("V3f", "N")])
def test_uvs_of_three_numbers_are_u_and_v(tmp_path: Path, kind: str, name: str) -> None:
    def extra(schema) -> None:
        parameter(schema, kind, name, abc.v3f([(u, v, 0) for u, v in UVS]))
        parameter(schema, "V2f", "map2", abc.array(imath.V2fArray, [imath.V2f(v, u) for u, v in UVS]))

    path = write(tmp_path / "a.abc", uvs=None, extra=extra)
    if name == "N":
        refused(SceneError, r"no mesh to bake \(/group/mesh has no UVs, but map2\)", Scene, path)
        return
    scene = Scene(path)
    assert scene.shapes[0].uv_name == name and scene.shapes[0].uvs.tolist() == list(map(list, UVS))
    assert not scene.warnings


def test_parameters_are_rest_rigidity_and_uvs(tmp_path: Path) -> None:
    def extra(schema) -> None:
        parameter(schema, "P3f", "Pref", abc.v3f([(3 * x, y, z) for x, y, z in POINTS]))
        parameter(schema, "Float", "stiff", abc.array(imath.FloatArray, [0, 0.5, 1] * 2))
        parameter(schema, "Float", "wrong", abc.array(imath.FloatArray, [0, 1]), [0, 1, 2, 0, 1, 0])
        parameter(schema, "V2f", "map2", abc.array(imath.V2fArray, [imath.V2f(v, u) for u, v in UVS]))

    path = write(tmp_path / "a.abc", extra=extra)
    shape = Scene(path, SceneOptions(rigidity_primvar="stiff", uv=("map2",))).shapes[0]
    assert shape.rest[5].tolist() == [6, 1, 0] and shape.vertex_rigidity.tolist() == [0, 0.5, 1, 0, 0.5, 1]
    assert shape.uv_name == "map2" and shape.uvs[2].tolist() == [0, 1] and shape.vertex_mask is None
    assert Scene(path, SceneOptions(rest="frame:3")).shapes[0].rest[2, 0] == pytest.approx(2.2)
    for options, message in (
        (SceneOptions(rest="bind"), "/group/mesh: Alembic has no skeletons"),
        (SceneOptions(rigidity_primvar="wrong"), "/group/mesh: wrong names a value that it does not have"),
        (SceneOptions(mask_primvar="none"), "no mesh has the primvar 'none' for the mask"),
        (SceneOptions(uv=("none",), meshes=("mesh",)), "/group/mesh: has no UVs 'none'"),
        (SceneOptions(meshes=("hat",)), "'hat' is no mesh of the scene"),
    ):
        refused(SceneError, message, Scene, path, options)


def test_rest_from_a_file(tmp_path: Path) -> None:
    rest = write(tmp_path / "rest.abc", subd=True)
    (tmp_path / "wide.obj").write_text("".join(f"v {4 * x} {y} {z}\n" for x, y, z in POINTS) + "f 1 4 5 2\nf 2 5 6 3\n")
    path = write(tmp_path / "a.abc")
    assert Scene(path, SceneOptions(rest=str(tmp_path / "wide.obj"))).shapes[0].rest[2, 0] == 8
    assert Scene(path, SceneOptions(rest=rest)).shapes[0].rest[2, 0] == 2


def test_topology_that_changes(tmp_path: Path) -> None:
    scene = Scene(write(tmp_path / "a.abc", then=[0, 3, 4, 1, 4, 1, 5, 2]))
    assert len(scene.positions("mesh", 1)) == 6
    with pytest.raises(SceneError, match=r"/group/mesh: sample 1 \(0\.0833 s\): the topology changes: face 2"):
        scene.positions("mesh", 2)


def test_hidden_objects_are_left_out(tmp_path: Path) -> None:
    path = tmp_path / "a.abc"
    archive = Abc.OArchive(str(path))
    for name, visible in (("on", 1), ("off", 0), ("inherits", -1)):
        mesh = abc.mesh(archive.getTop(), name, [POINTS], FACES, uvs=UVS)
        Abc.OCharProperty(mesh.getProperties(), "visible").setValue(visible)
    del mesh, archive
    scene = Scene(path)
    assert [shape.name for shape in scene.shapes] == ["on", "inherits"]
    assert [(entry.mesh, entry.why, entry.meant) for entry in scene.left_out] == [("/off", "is hidden", True)]
    refused(SceneError, "/off: is hidden", Scene, path, SceneOptions(meshes=("off",)))


def test_subdivision_surfaces_are_refined(tmp_path: Path) -> None:
    shape = Scene(write(tmp_path / "a.abc", subd=True), SceneOptions(subdivide=2)).shapes[0]
    assert len(shape.face_counts) == 32 and np.array_equal(shape.rest.max(axis=0), [2, 1, 0])
    assert len(Scene(write(tmp_path / "b.abc"), SceneOptions(subdivide=2)).shapes[0].face_counts) == 2


def test_instances_are_one_shape(tmp_path: Path) -> None:
    def write_instances(path: Path, scale: float) -> Path:
        archive = Abc.OArchive(str(path))
        group = AbcGeom.OXform(archive.getTop(), "group")
        poses = [[(width if x == 2 else x, y, z) for x, y, z in POINTS] for width in (2, 3)]
        mesh = abc.mesh(group, "mesh", poses, FACES, abc.sampled(archive, fps=24), UVS)
        archive.getTop().addChildInstance(group, "again")
        deep = abc.placed(archive.getTop(), "deep", [np.diag([scale, 1.0, 1.0, 1.0])])
        deep.addChildInstance(mesh, "third")
        return path

    path = write_instances(tmp_path / "a.abc", 1)
    (shape,) = Scene(path).shapes
    assert shape.instances == ("/group/mesh", "/again/mesh", "/deep/third") and shape.path == "/group/mesh"
    assert Scene(path).positions(shape, 2)[2, 0] == 3
    assert [found.path for found in Scene(path, SceneOptions(meshes=("/again",))).shapes] == ["/again/mesh"]
    # With their transforms they are one as long as these scale them alike.
    assert len(Scene(path, SceneOptions(world=True)).shapes) == 1
    apart = Scene(write_instances(tmp_path / "b.abc", 2), SceneOptions(world=True)).shapes
    assert [found.instances for found in apart] == [("/group/mesh", "/again/mesh"), ("/deep/third",)]


def forget(monkeypatch: pytest.MonkeyPatch, *packages: str) -> None:
    """Takes modules out of those that are loaded, with all below them."""
    for name in [name for name in sys.modules if name.startswith(packages)]:
        monkeypatch.delitem(sys.modules, name)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("import imath_that_is_not_there", "ModuleNotFoundError: No module named 'imath_that_is_not_there'"),
        ("raise TypeError('no class registered')", "TypeError: no class registered"),
        ("", "ImportError: cannot import name 'Abc' from 'alembic3d'"),
    ],
)
def test_a_wheel_that_cannot_be_loaded_says_why(tmp_path: Path, monkeypatch, text: str, told: str) -> None:
    path = write(tmp_path / "a.abc")
    (tmp_path / "alembic3d.py").write_text(text)
    (tmp_path / "imath.py").touch()
    monkeypatch.syspath_prepend(tmp_path)
    forget(monkeypatch, "alembic3d", "imath", "vrtm.bake.scene.alembic")
    with pytest.raises(SceneError, match="which cannot be loaded: ") as raised:
        Scene(path)
    assert told in str(raised.value) and "pip install" not in str(raised.value)
    # Without it the error names the extra.
    monkeypatch.setitem(sys.modules, "alembic3d", None)
    refused(SceneError, r"alembic3d: pip install 'vrtm\[alembic\]'", Scene, path)
