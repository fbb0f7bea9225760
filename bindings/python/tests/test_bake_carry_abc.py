"""`vrtm bake --carry-prims` of Alembic archives: what rides on a sheet that is stretched and turned."""

import struct
from pathlib import Path
from typing import Any

import imath
import numpy as np
import pytest
from alembic3d import Abc, AbcGeom
from pxr import Gf, Sdf, Usd, UsdGeom

import alembic_scenes as abc
import scenes
import test_bake_carry
from alembic_scenes import found, posed, properties
from bake_scenes import files, image, run
from conftest import grid
from test_bake_carry import PLACES, TURN
from test_bake_carry import posed as stretched
from test_bake_signals import limited

SKIN = "/model/skin"
HAIR = np.array([(0.2, 0.3, 0), (0.25, 0.32, 0.1), (0.4, 0.3, 0.2), (0.7, 0.7, 0), (0.9, 0.7, 0.3)])
DETAIL, DETAIL_FACES = grid(4)
DETAIL = np.add(0.5 + 0.15 * (DETAIL - 0.5), [0, 0, -0.425])


def skin(archive: Any, parent: Any) -> None:
    """A unit square at z = 0, whose second frame is stretched and turned."""
    rest, faces = grid(6)
    uvs = 0.1 + 0.8 * rest[:, :2]
    abc.mesh(parent, "skin", [rest, stretched(rest)], faces, abc.sampled(archive), uvs)


def scatter(archive: Any, parent: Any) -> None:
    """One object of each kind."""
    dots = abc.points(parent, "dots", [PLACES])
    abc.curves(parent, "hair", HAIR, [3, 2])
    detail = abc.mesh(parent, "detail", [DETAIL], DETAIL_FACES, uvs=DETAIL[:, :2])
    half = detail.getSchema().createFaceSet("half")
    half.getSchema().set(AbcGeom.OFaceSetSchemaSample(abc.ints(range(8))))
    abc.mesh(parent, "smooth", [DETAIL], DETAIL_FACES, subd=True)
    # A property over time, at times of its own.
    params = dots.getSchema().getArbGeomParams()
    glow = AbcGeom.OFloatGeomParam(params, "glow", False, abc.VERTEX, 1, abc.sampled(archive, 3))
    for k in range(3):
        glow.set(AbcGeom.OFloatGeomParamSample(abc.array(imath.FloatArray, [k, k + 0.5, 0, 1]), abc.VERTEX))


def scene(folder: Path, *, beside: Any = scatter) -> Path:
    """The archive of the skin and of what is on it."""
    painted(folder)

    def author(archive: Any, parent: Any) -> None:
        skin(archive, parent)
        beside(archive, AbcGeom.OXform(parent, "on"))

    return abc.write(folder / "skin.abc", author)


def painted(folder: Path) -> None:
    """A map of nothing rigid."""
    image(folder / "rigid.png", np.zeros((64, 64, 1), np.uint8))


def bake(folder: Path, *more: object, expect: int | None = 0, file: str = "skin.abc") -> str:
    return test_bake_carry.bake(folder, None, *more, expect=expect, file=file)


def test_all_kinds_ride_on_a_stretched_plane(tmp_path: Path) -> None:
    shot = scene(tmp_path)
    said = bake(tmp_path, "--carry-prims", "/model/on")
    assert "/model/on/hair: curves, 2 places, carried by /model/skin" in said
    assert "carries 56 places, 0 rigid features; 0 outside of UVs, 0 too far" in said
    made = tmp_path / "out" / "carried.abc"
    roots = HAIR[[0, 0, 0, 3, 3]]
    for name, rest, pose in (
        ("dots", PLACES, stretched(PLACES)),
        ("hair", HAIR, stretched(roots) + (HAIR - roots) @ TURN.T),
        ("detail", DETAIL, stretched(DETAIL)),
        ("smooth", DETAIL, stretched(DETAIL)),
    ):
        path = f"/model/on/{name}"
        np.testing.assert_allclose(posed(made, path, 1), rest, atol=1e-6)
        np.testing.assert_allclose(posed(made, path, 2), pose, atol=1e-5)
        bounds = found(made, path).getSchema().getSelfBoundsProperty().getValue(Abc.ISampleSelector(1))
        np.testing.assert_allclose([list(bounds.min()), list(bounds.max())], [pose.min(0), pose.max(0)], atol=1e-5)
        before, after = properties(shot, path), properties(made, path)
        moved = {"/.geom/P", "/.geom/.selfBnds", "/.geom/.velocities"}
        assert {key: before[key] for key in before.keys() - moved} == {key: after[key] for key in after.keys() - moved}
        assert after["/.geom/P"][1] == before["/.geom/P"][1], "how the points are to be read"
        assert "/.geom/.velocities" not in after
    assert "/.geom/.velocities" in properties(shot, "/model/on/dots")
    assert properties(made, "/model/on/detail/half") == properties(shot, "/model/on/detail/half")
    sampling = found(made, "/model/on/dots").getSchema().getTimeSampling()
    assert sampling.getTimeSamplingType().isUniform() and sampling.getSampleTime(1) == pytest.approx(2 / 25)
    glow = found(made, "/model/on/dots").getSchema().getArbGeomParams()
    times = AbcGeom.IFloatGeomParam(glow, "glow").getTimeSampling()
    assert [times.getSampleTime(k) for k in range(3)] == pytest.approx([3 / 25, 4 / 25, 5 / 25])
    top = Abc.IArchive(str(made)).getTop()
    assert [top.getChild(0).getChild(k).getName() for k in range(top.getChild(0).getNumChildren())] == ["on"]
    assert float(top.getMetaData().get("_ai_DCC_FPS")) == 25


def matrix(axis: Gf.Vec3d, angle: float, by: Gf.Vec3d, scale: float = 1.0) -> np.ndarray:
    return np.array(Gf.Matrix4d().SetScale(scale) * Gf.Matrix4d(Gf.Rotation(axis, angle), by))


def test_transforms_above_both(tmp_path: Path) -> None:
    above = [matrix(Gf.Vec3d(0, 1, 1), 20.0 * k, Gf.Vec3d(k, 0, 1), 2.0) for k in (1, 2)]
    own = [matrix(Gf.Vec3d(1, 1, 0), 70, Gf.Vec3d(3, 2, k), 0.5) for k in (1, 2)]

    def moved(points: np.ndarray, by: np.ndarray) -> np.ndarray:
        return points @ by[:3, :3] + by[3, :3]

    # In a space that moves otherwise, on the skin at rest.
    local = moved(PLACES, above[0] @ np.linalg.inv(own[0]))

    def author(archive: Any, parent: Any) -> None:
        times = abc.sampled(archive)
        skin(archive, abc.placed(parent, "body", above, times))
        abc.points(abc.placed(parent, "other", own, times), "dots", [local])

    painted(tmp_path)
    shot = abc.write(tmp_path / "skin.abc", author)
    bake(tmp_path, "--carry-prims", "/model/other/dots")
    made = tmp_path / "out" / "carried.abc"
    np.testing.assert_allclose(posed(made, "/model/other/dots", 1), local, atol=3e-5)
    want = moved(stretched(PLACES), above[1] @ np.linalg.inv(own[1]))
    np.testing.assert_allclose(posed(made, "/model/other/dots", 2), want, atol=3e-5)
    assert properties(made, "/model/other") == properties(shot, "/model/other")
    bake(tmp_path, "--carry-prims", "/model/other/dots", "--world")
    np.testing.assert_allclose(posed(made, "/model/other/dots", 2), want, atol=3e-5)


def test_a_second_run_does_nothing_and_a_change_is_taken(tmp_path: Path) -> None:
    def three(archive: Any, parent: Any) -> None:
        rest, faces = grid(6)
        poses = [rest, stretched(rest), rest, stretched(rest)]
        abc.mesh(parent, "skin", poses, faces, abc.sampled(archive), 0.1 + 0.8 * rest[:, :2])

    painted(tmp_path)
    abc.write(tmp_path / "skin.abc", three)

    def beside(width: float) -> None:
        def author(_: Any, parent: Any) -> None:
            made = abc.points(parent, "dots", [PLACES])
            Abc.OFloatProperty(made.getSchema().getUserProperties(), "width").setValue(width)

        abc.write(tmp_path / "scatter.abc", author)

    beside(1)
    asked = ("--carry", tmp_path / "scatter.abc", "--carry-prims", "/model/dots", "--frames", "1,2,4")
    first = bake(tmp_path, *asked)
    before = files(tmp_path / "out")
    again = bake(tmp_path, *asked)
    assert "0 files written, 4 up to date" in again and files(tmp_path / "out") == before
    assert next(line for line in first.splitlines() if "carries" in line) in again
    made = tmp_path / "out" / "carried.abc"
    sampling = found(made, "/model/dots").getSchema().getTimeSampling()
    assert sampling.getTimeSamplingType().isAcyclic()
    assert [sampling.getSampleTime(k) for k in range(3)] == pytest.approx([1 / 25, 2 / 25, 4 / 25])
    # What is only copied counts, too.
    beside(2)
    assert "1 file written, 3 up to date" in bake(tmp_path, *asked)
    assert properties(made, "/model/dots")["/.geom/.userProperties/width"][0] == ["2.0"]
    assert "1 file written, 3 up to date" in bake(tmp_path, *asked, "--carry-pieces", "connected")
    assert "1 file written, 3 up to date" in bake(tmp_path, *asked, "--carry-farthest", 1)
    mine = abc.write(tmp_path / "mine.abc", skin).read_bytes()
    for content in (mine, made.read_bytes()[:200], b"mine"):
        made.write_bytes(content)
        said = bake(tmp_path, *asked, expect=2)
        assert "carried.abc is there, and is no file that vrtm has written" in said and made.read_bytes() == content
    bake(tmp_path, *asked, "--overwrite")
    assert len(posed(made, "/model/dots", 2)) == 4
    (tmp_path / "carried.abc").write_bytes(made.read_bytes())
    here = ("--carry", made, "--carry-prims", "/model/dots")
    assert "carried.abc would replace" in bake(tmp_path, *here, expect=2)
    bake(tmp_path, "--carry", tmp_path / "carried.abc", "--carry-prims", "/model/dots")


def test_an_archive_over_a_usd_shot_and_usd_over_an_archive(tmp_path: Path) -> None:
    abc.write(tmp_path / "scatter.abc", scatter)
    painted(tmp_path)
    stage = scenes.stage(tmp_path / "skin.usda", 2, 4, fps=None)
    stage.SetTimeCodesPerSecond(50)
    rest, faces = grid(6)
    scenes.mesh(stage, SKIN, rest, 0.1 + 0.8 * rest[:, :2], faces=faces, poses={2: rest, 4: stretched(rest)})
    stage.Save()
    bake(tmp_path, "--carry", tmp_path / "scatter.abc", "--carry-prims", "/model/dots", file="skin.usda")
    made = tmp_path / "out" / "carried.abc"
    # Time code 4 is frame 2 of 25 per second.
    np.testing.assert_allclose(posed(made, "/model/dots", 1), PLACES, atol=1e-6)
    np.testing.assert_allclose(posed(made, "/model/dots", 2), stretched(PLACES), atol=1e-5)
    assert found(made, "/model/dots").getSchema().getNumSamples() == 3

    scene(tmp_path)
    other = Usd.Stage.CreateNew(str(tmp_path / "scatter.usda"))
    other.SetTimeCodesPerSecond(100)
    UsdGeom.Points.Define(other, "/dots").CreatePointsAttr(np.float32(PLACES))
    other.Save()
    said = bake(tmp_path, "--carry", tmp_path / "scatter.usda", "--carry-prims", "/dots")
    assert "carried.usdc: skin carries 4 places" in said
    layer = Sdf.Layer.FindOrOpen(str(tmp_path / "out" / "carried.usdc"))
    assert layer.timeCodesPerSecond == 100 and layer.ListTimeSamplesForPath("/dots.points") == [4, 8]
    np.testing.assert_allclose(np.array(layer.QueryTimeSample("/dots.points", 8)), stretched(PLACES), atol=1e-5)


def oriented(archive: Any, parent: Any) -> None:
    dots = abc.points(parent, "dots", [PLACES])
    turns = AbcGeom.OQuatfGeomParam(dots.getSchema().getArbGeomParams(), "orient", False, abc.VERTEX, 1)
    turns.set(AbcGeom.OQuatfGeomParamSample(abc.array(imath.QuatfArray, [imath.Quatf(1, 0, 0, 0)] * 4), abc.VERTEX))


def test_what_cannot_be_kept_is_told(tmp_path: Path) -> None:
    shot = scene(tmp_path, beside=oriented)
    ids = struct.pack("<4Q", 5, 6, 7, 8)
    data = shot.read_bytes()
    assert data.count(ids) == 1
    shot.write_bytes(data.replace(ids, struct.pack("<4Q", 5, 6, (1 << 40) + 9, 8)))
    said = bake(tmp_path, "--carry-prims", "/model/on")
    assert "/model/on/dots: orient stays as it is" in said
    assert "/model/on/dots: .pointIds has numbers that need more than 32 bits" in said
    made = tmp_path / "out" / "carried.abc"
    turns = "/.geom/.arbGeomParams/orient"
    assert properties(made, "/model/on/dots")[turns] == properties(shot, "/model/on/dots")[turns]


def changing(archive: Any, parent: Any) -> None:
    abc.points(parent, "dots", [PLACES, PLACES[:3]], abc.sampled(archive))
    abc.points(parent, "none", [PLACES[:0]])
    abc.points(parent, "odd", [np.where(PLACES == PLACES[1, 0], np.nan, PLACES)])
    abc.mesh(parent, "turned", [PLACES] * 2, [0, 1, 2, 3], abc.sampled(archive), then=[3, 2, 1, 0])
    lost = AbcGeom.OPolyMesh(parent, "lost")
    lost.getSchema().set(
        AbcGeom.OPolyMeshSchemaSample(abc.v3f(np.add(PLACES, [0, 0, 0.005])), abc.ints([0, 1, 7]), abc.ints([3]))
    )
    abc.curves(parent, "hair", HAIR, [3, 3])


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("/model/om",), "skin.abc has no such object: did you mean /model/on"),
        ((SKIN,), "it is none of Points, Curves, PolyMesh, SubD that is not baked, nor has one below"),
        (("/model/on/dots",), "/model/on/dots: not carried: has another topology in some samples"),
        (("/model/on/turned",), "/model/on/turned: not carried: has another topology in some samples"),
        (("/model/on/none",), "/model/on/none: not carried: has no points at rest"),
        (("/model/on/odd",), "/model/on/odd: not carried: has a point that is not finite: 1"),
        (("/model/on/hair",), "/model/on/hair: not carried: has 5 points, and curves with 6"),
        (
            ("/model/on/lost", "--carry-pieces", "connected"),
            "/model/on/lost: not carried: has 4 points, and a face with point 7",
        ),
        (("/", "--carry", "none.abc"), "--carry none.abc: no such file"),
        (("/model/on/lost", "--carry-farthest", 1e-9), "must be in the world of the mesh at rest"),
    ],
)
def test_what_is_wrong_is_named_before_anything_is_baked(tmp_path: Path, options: tuple, said: str) -> None:
    scene(tmp_path, beside=changing)
    assert said in bake(tmp_path, "--strict", "--carry-prims", *options, expect=2)
    assert not (tmp_path / "out").exists()


def test_damaged_archives_are_named(tmp_path: Path) -> None:
    scene(tmp_path)
    other = abc.write(tmp_path / "scatter.abc", scatter)
    whole = other.read_bytes()
    asked = ("--carry", other, "--carry-prims", "/model")
    for content in (b"", b"nothing", whole[: len(whole) // 2], whole[:-1]):
        other.write_bytes(content)
        assert "scatter.abc: not an Alembic file" in bake(tmp_path, *asked, expect=2)
    other.write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(500))
    said = bake(tmp_path, *asked, expect=2)
    assert "an Alembic file in HDF5" in said and "convert it with 'abcconvert -toOgawa" in said
    # Of what tells where the data are, some is lost.
    rng = np.random.default_rng(1)
    for _ in range(6):
        data = bytearray(whole)
        start = int(rng.integers(16, len(data) - 64))
        data[start : start + 8] = b"\xff" * 8
        other.write_bytes(bytes(data))
        said = bake(tmp_path, *asked, expect=None)
        assert "Traceback" not in said, said
    assert not any(path.name.endswith(".part") for path in (tmp_path / "out").glob("*"))


def test_an_archive_is_whole_or_not_there(tmp_path: Path) -> None:
    places = np.random.default_rng(1).random((5000, 3)) * [0.9, 0.9, 0.01]

    def many(_: Any, parent: Any) -> None:
        abc.points(parent, "dots", [places])

    shot = scene(tmp_path, beside=many)
    asked = ("--size", 32, "--device", "cpu", "--jobs", 1, "--meshes", "skin", "--carry-prims", "/model/on")
    command = ["bake", shot, "--rigidity", tmp_path / "rigid.png", *asked, "--out"]
    run(*command, tmp_path / "whole")
    size = (tmp_path / "whole" / "carried.abc").stat().st_size
    assert size > 150_000
    for largest in (size, size // 2):
        code, told = limited([*command, tmp_path / "out"], largest)
        assert code == 2 and "carried.abc: " in told.splitlines()[-1], told
        assert not list((tmp_path / "out").glob("*carried*"))
    assert limited([*command, tmp_path / "out"], size + (2 << 20))[0] == 0
