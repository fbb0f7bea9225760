"""A rest in another unit than the poses, against deformations and scales that are meant."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from pxr import Sdf, Usd

from bake_scenes import flat, opened
from conftest import sheet
from scenes import POINTS, TYPES, mesh, primvar, stage
from vrtm.bake import remarks
from vrtm.bake.rows import figures
from vrtm.bake.scene import Scene, SceneOptions, Shape
from vrtm.bake.units import Finding, Units
from vrtm.bake.work import Work

FRAMES = tuple(range(1, 11))
Pose = Callable[[np.ndarray, int], np.ndarray]


def shape(unit: float = 1.0) -> Shape:
    model = sheet(9)
    faces = model.faces.astype(np.int32)
    counts = np.full(len(faces), 4, np.int32)
    indices = faces.ravel()
    return Shape(
        "sheet", "/sheet", model.rest, counts, indices, model.uvs, indices, "st", rest_from="Pref", rest_unit=unit
    )


def units(pose: Pose, unit: float = 1.0, frames: tuple[int, ...] = FRAMES) -> tuple[Units, Finding]:
    found = Units(shape(unit), frames, lambda frame: pose(shape().rest, frame))
    return found, found.finding()


def bent(rest: np.ndarray, frame: int) -> np.ndarray:
    """More from frame to frame, everywhere; at rest in frame 1."""
    x, y, z = rest.T
    amount = (frame - 1) / 9
    return np.stack([x * (1 + 0.6 * amount * x), y + 0.2 * amount * np.sin(3 * x), z + 0.3 * amount * y * y], -1)


def stretched(rest: np.ndarray, frame: int) -> np.ndarray:
    """Along x, and one half alone."""
    return np.where(rest > 0.5, rest + (rest - 0.5) * [0.08 * frame, 0, 0], rest)


@pytest.mark.parametrize("factor", [2.54, 3.28084, 1.1, 0.01, 0.9, 10, 100])
@pytest.mark.parametrize("pose", [bent, stretched, lambda rest, frame: rest])
def test_one_factor_in_all_frames_scales_the_rest(factor: float, pose: Pose) -> None:
    if pose is stretched and factor in (1.1, 0.9):
        # Of a mesh that is deformed in all frames that may be a part that is larger on purpose.
        assert units(lambda rest, frame: factor * pose(rest, frame))[1].factor == 1
        return
    _, finding = units(lambda rest, frame: (factor * pose(rest, frame)).astype(np.float32))
    assert finding.factor == pytest.approx(factor, rel=1e-6) and not finding.ends
    assert f"all of its edges are {factor:.6g} times as long as at rest (the rest is from Pref)" in finding.warning


def test_what_the_layers_say_counts_where_lengths_bear_it_out() -> None:
    _, finding = units(lambda rest, frame: 0.01 * bent(rest, frame + 3), unit=0.01)
    assert (finding.factor, finding.reason, finding.warning) == (0.01, "as metersPerUnit says", "")
    assert units(lambda rest, frame: bent(rest, frame + 3), unit=0.01)[1] == Finding()
    # On top of it: a file of the wrong unit.
    _, finding = units(lambda rest, frame: 2.54 * 0.01 * bent(rest, frame), unit=0.01)
    assert finding.factor == pytest.approx(0.0254) and "2.54 times" in finding.warning


@pytest.mark.parametrize(
    "pose",
    [
        bent,
        stretched,
        # Held, along one axis alone.
        lambda rest, frame: rest * [1.5, 1, 1],
        # A part that is larger on purpose.
        lambda rest, frame: np.where(rest[:, :1] > 0.5, 1.2 * rest, bent(rest, 5)),
        # Growth, with and without a deformation, by less and by more than between units.
        lambda rest, frame: rest * (0.9 + 0.1 * frame),
        lambda rest, frame: bent(rest, frame) * (0.9 + 0.1 * frame),
        lambda rest, frame: rest * 1.4 ** (frame - 1),
        lambda rest, frame: rest * 1.4 ** (10 - frame),
        # Nothing is left of it.
        lambda rest, frame: rest * 0,
        lambda rest, frame: rest * np.nan,
    ],
)
def test_deformations_and_growth_are_left_alone(pose: Pose) -> None:
    found, finding = units(pose)
    assert finding == Finding()
    assert [found.jump(frame, pose(shape().rest, frame)) for frame in FRAMES] == [Finding()] * len(FRAMES)


def test_growth_that_begins_before_the_shot_is_told() -> None:
    found, finding = units(lambda rest, frame: rest * (1 + 0.1 * frame))
    assert (finding.factor, finding.ends) == (1, False) and "1.1 to 2 times as long" in finding.warning
    assert found.jump(10, 2 * shape().rest) == Finding()


@pytest.mark.parametrize(("factor", "ends"), [(100, True), (0.01, True), (10, True), (2.54, False)])
def test_a_unit_that_changes_between_two_frames_is_named(factor: float, ends: bool) -> None:
    def after(rest: np.ndarray, frame: int) -> np.ndarray:
        return bent(rest, frame) * (factor if frame >= 6 else 1)

    def before(rest: np.ndarray, frame: int) -> np.ndarray:
        return bent(rest, frame) * (factor if frame < 2 else 1)

    found, finding = units(after)
    assert finding == Finding()
    if ends:
        told = [found.jump(frame, after(shape().rest, frame)) for frame in FRAMES]
        assert [bool(finding.warning) for finding in told] == [False] * 5 + [True] * 5
        assert all("in frame 6 " in entry.warning and "as in frame 5" in entry.warning for entry in told[5:])
        assert all(entry.ends for entry in told[5:])
    else:
        # Known of frames alone that are not deformed otherwise.
        found, _ = units(lambda rest, frame: rest * (factor if frame >= 6 else 1))
        told = [found.jump(frame, shape().rest * factor) for frame in (6, 7, 8)]
        assert [bool(entry.warning) for entry in told] == [True, False, False] and not told[0].ends
    found, finding = units(before)
    assert (finding.factor, finding.ends) == (1, False)
    told = found.jump(1, before(shape().rest, 1))
    assert told.ends == ends and "in frame 2 " in told.warning and "as in frame 1" in told.warning


def test_a_unit_that_cannot_be_told_ends_the_bake_or_is_warned_of() -> None:
    _, finding = units(lambda rest, frame: 12 * bent(rest, frame + 4))
    assert finding.ends and finding.factor == 1 and "--allow-units" in finding.warning
    _, finding = units(lambda rest, frame: 2.54 * bent(rest, frame + 4))
    assert not finding.ends and finding.factor == 1 and "as if one of them were in another unit" in finding.warning


def work(scene: Path, allow_units: bool = False, scale: str = "keep", **options: object) -> Work:
    rigidity = str(flat(scene.parent / "rigid.png"))
    return opened(scene, SceneOptions(**options), rigidity=rigidity, allow_units=allow_units, scale=scale)


def shot(path: Path, factor: float, meters: float = 0.01) -> Usd.Stage:
    made = stage(path, meters=meters)
    right, rest = np.equal(POINTS, [2, 9, 9]), factor * np.array(POINTS)
    mesh(made, "/cloth", rest, poses={frame: rest + 0.1 * factor * (frame - 1) * right for frame in range(1, 6)})
    return made


def test_units_of_pref_and_of_rest_files(tmp_path: Path) -> None:
    made = shot(tmp_path / "inches.usda", 2.54)
    primvar(made.GetPrimAtPath("/cloth"), "Pref", TYPES.Point3fArray, POINTS, "vertex")
    made.Save()
    with work(tmp_path / "inches.usda") as bake:
        (told,) = [note for note in remarks.notes(bake) if "another unit" in note]
        assert told.startswith("/cloth: all of its edges are 2.54 times as long as at rest (the rest is from Pref)")
        assert bake.shapes[0].rest[2, 0] == pytest.approx(5.08)
        bake.check_units()
    with work(tmp_path / "inches.usda", allow_units=True) as bake:
        assert bake.shapes[0].rest[2, 0] == 2 and not [note for note in remarks.notes(bake) if "unit" in note]
    # Features that follow the scale need no units.
    with work(tmp_path / "inches.usda", scale="follow") as bake:
        assert bake.shapes[0].rest[2, 0] == 2 and not [note for note in remarks.notes(bake) if "unit" in note]
        bake.check_units()
        (part,) = bake.parts
        part.solve(1, 2.54 * bake.shapes[0].rest, part.tiles, False, False, False, lambda: None)
        told = figures(part.tiles[0], (16, 16), None, bake.settings)
        assert told["scale"] == pytest.approx(2.54) and told["scale_spread"] < 1e-3 and told["max_displacement"] == 0
    # The layers say it: Pref is from one in meters, the poses from one in centimeters.
    shot(tmp_path / "shot.usda", 100, 0.01).Save()
    model = stage(tmp_path / "model.usda", meters=1)
    primvar(mesh(model, "/cloth").GetPrim(), "Pref", TYPES.Point3fArray, POINTS, "vertex")
    model.Save()
    layer = Sdf.Layer.FindOrOpen(str(tmp_path / "shot.usda"))
    layer.subLayerPaths = ["./model.usda"]
    layer.Save()
    for options in ({}, {"rest": str(tmp_path / "model.usda")}):
        with work(tmp_path / "shot.usda", **options) as bake:
            assert not [note for note in remarks.notes(bake) if "unit" in note]
            assert bake.shapes[0].rest[2, 0] == pytest.approx(200)
            assert "100 times as large as metersPerUnit says: /cloth" in remarks.facts(bake)[-1]
    # One that says nothing is known by its edges.
    model.GetRootLayer().pseudoRoot.ClearInfo("metersPerUnit")
    model.Save()
    assert Scene(tmp_path / "shot.usda", SceneOptions(rest=str(tmp_path / "model.usda"))).shapes[0].rest_unit == 1
    with work(tmp_path / "shot.usda", rest=str(tmp_path / "model.usda")) as bake:
        assert bake.shapes[0].rest[2, 0] == pytest.approx(200)
        assert [note for note in remarks.notes(bake) if "100 times as long" in note]
