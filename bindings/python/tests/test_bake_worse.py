"""Features that are worse than without vrtm in a bake: counted, told, and limited."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

import scenes
from bake_scenes import flat, image, run
from conftest import grid

MESH, SIDE = "/model/skin", 64


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    """A sheet that is crowded with 8 x 8 squares, and whose left half shrinks in the second of two frames."""
    stage = scenes.stage(tmp_path / "shot.usda", 1, 2)
    rest, faces = grid(16)
    poses = {frame: rest - [0.25 * (frame - 1), 0, 0] * np.minimum(2 * rest, 1) for frame in (1, 2)}
    scenes.mesh(stage, MESH, rest, rest[:, :2], faces=faces, poses=poses, pref=True)
    stage.Save()
    y, x = np.mgrid[:SIDE, :SIDE] % 8
    row = np.arange(512) % 64 == 30
    image(tmp_path / "1.png", np.where(row[:, None] & row, 255, 0).astype(np.uint8)[..., None])
    flat(tmp_path / "0.png", 0)
    for value in (255, 127, 102):
        image(tmp_path / f"{value}.png", np.where((x > 1) & (y > 1), value, 0).astype(np.uint8)[..., None])
    return tmp_path / "shot.usda"


def bake(scene: Path, *more: object, value: int = 255, expect: int = 0):
    rigidity, out = scene.parent / f"{value}.png", scene.parent / f"out{value}"
    options = ("--size", SIDE, "--seams", "shut", "--device", "cpu", "--jobs", 1, "--report", scene.parent / "r.json")
    return run("bake", scene, "--rigidity", rigidity, "--out", out, *options, *more, expect=expect)


def test_features_that_are_worse_are_told_and_limited(scene: Path) -> None:
    ended = bake(scene, "--measure")
    report = json.loads((scene.parent / "r.json").read_text())
    still, crowded = (frame["tiles"][0]["features"] for frame in report["frames"])
    assert still["count"] == crowded["count"] == 64
    assert (still["worse"], still["worst"], still["strained"]) == (0, [], {"before": 0, "after": 0})
    count, worst = crowded["worse"], crowded["worst"][0]
    assert 0 < count <= 32 and len(crowded["worst"]) == min(count, 16) and crowded["strained"]["before"] == 32
    # In the half that keeps its shape.
    assert worst["u"] > 0.5 and worst["before"] < 1e-3 and worst["after"] > 0.02
    (mesh,) = report["meshes"]
    assert mesh["features"] == {"count": 64, "worse": count, "frame": 2, "worst": {"frame": 2} | worst}
    line = rf"{count} of 64 features are worse than without vrtm in frame 2: the worst at UV [\d.]+, [\d.]+: "
    assert re.search(line + r"[\d.e-]+ -> [\d.]+ RMS, frame 2, ", ended.stdout)
    assert bake(scene, "--max-worse", count).returncode == 0
    ended = bake(scene, "--max-worse", count - 1, expect=3)
    assert f"--max-worse {count - 1} was exceeded in 1 of 2: skin, frame 2, tile 1001: " in ended.stderr
    assert f"worse than without vrtm: {count}, the worst at UV" in ended.stderr
    assert "--max-worse" in bake(scene, "--max-worse", -1, expect=2).stderr


@pytest.mark.parametrize("value", [127, 102])
def test_grey_paint_is_measured(scene: Path, value: int) -> None:
    ended = bake(scene, "--max-strain", 0.01, value=value, expect=3)
    assert "nothing gained" not in ended.stdout and "--max-strain 0.01 was exceeded in 1 of 2" in ended.stderr
    tile = json.loads((scene.parent / "r.json").read_text())["frames"][1]["tiles"][0]
    assert 0.01 < tile["strain"]["after"]["rms"] < tile["strain"]["before"]["rms"]
    assert tile["features"]["count"] == 64


@pytest.mark.parametrize("limit", [("--max-strain", 0.9), ("--max-worse", 9)])
def test_a_limit_is_not_kept_where_nothing_was_measured(scene: Path, limit: tuple) -> None:
    # Dots that are too small for two nodes of the grid.
    for _ in range(2):
        ended = bake(scene, *limit, value=1, expect=3)
        assert f"{limit[0]} could not be checked in 2 places: skin, frame 1, tile 1001: the painted" in ended.stderr
        assert "nothing gained" not in ended.stdout and "strain not measured: the painted" in ended.stdout
        tile = json.loads((scene.parent / "r.json").read_text())["frames"][1]["tiles"][0]
        assert tile["strain"]["unmeasured"] and tile["max_displacement"] > 0
    # Where nothing is rigid there is nothing to measure.
    assert "nothing is rigid" in bake(scene, *limit, "--meshes", "skin", value=0).stdout
    layer = ("--layer", scene.parent / "over.usda", "--only-layer")
    said = bake(scene, *limit, *layer, value=1, expect=None).stderr
    assert f"--only-layer solves nothing: {limit[0]} cannot be checked" in said


def test_grey_paint_that_is_fixed_is_told(scene: Path) -> None:
    flat(scene.parent / "mask.png", 0)
    ended = bake(scene, "--mask", scene.parent / "mask.png", "--max-strain", 0.9, value=102, expect=3)
    assert "cannot be met in 2 of 2: skin, frame 1, tile 1001: 100.0% of the rigid segments are fixed" in ended.stderr
