"""Maps that would be the identity in all frames get no file: parts that move rigidly, and parts with nothing rigid.
Features that are worse than without vrtm are counted, told, and limited."""

import dataclasses
import json
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from pxr import Sdf, Usd, UsdGeom, UsdShade

import scenes
from bake_scenes import files, flat, image, run
from conftest import centres, grid
from shots import composed
from vrtm import cli
from vrtm.bake import gain
from vrtm.bake.scene.types import Shape

CELLS = 4
FRAMES = 3
TOY = "/model/toy"

Move = Callable[[np.ndarray, int], np.ndarray]


def turns(points: np.ndarray, frame: int) -> np.ndarray:
    angle = 0.7 * frame
    turn = np.array([[np.cos(angle), np.sin(angle), 0], [-np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    return points @ turn + [frame, 0, 1]


def bends(points: np.ndarray, frame: int) -> np.ndarray:
    """At rest but for the last frame."""
    moved = points.copy()
    moved[:, 0] += (frame == FRAMES) * 0.3 * np.sin(3 * points[:, 1])
    return moved


def toy(folder: Path, *parts: tuple[Move, int, bool], make=scenes.materialx_material, scheme: str = "none") -> Path:
    """Sheets in one mesh, each with its motion, the number of its tile less 1001, and whether studs on it are rigid:
    these lie in the left half of the tile, others in the right. Sheets of one tile lie over one another."""
    folder.mkdir(parents=True, exist_ok=True)
    stage = scenes.stage(folder / "shot.usda", 1, FRAMES)
    square, faces = grid(CELLS)
    sheets = [np.add(square, (1.5 * number, 0, 0)) for number in range(len(parts))]
    uvs = [square[:, :2] * (0.4, 0.9) + (tile + (0.05 if rigid else 0.55), 0.05) for _, tile, rigid in parts]
    poses = {
        frame: np.concatenate([move(rest, frame) for rest, (move, _, _) in zip(sheets, parts)])
        for frame in range(1, FRAMES + 1)
    }
    faces = np.concatenate([faces + len(square) * number for number in range(len(parts))])
    rest = np.concatenate(sheets)
    mesh = scenes.mesh(stage, TOY, rest, np.concatenate(uvs), faces=faces, poses=poses, pref=True)
    mesh.CreateSubdivisionSchemeAttr(scheme)
    if make is not None:
        scenes.bind(mesh, make(stage, "/model/skin"))
    stage.Save()
    u, v = centres(32)
    studs = (np.hypot((u * 4) % 1 - 0.5, (v * 2) % 1 - 0.5) < 0.3) & (u < 0.5)
    for udim in sorted({1001 + tile for _, tile, _ in parts}):
        image(folder / f"rigid.{udim}.png", (255 * studs).astype(np.uint8)[..., None])
        image(folder / f"colour.{udim}.png", np.repeat((255 * u).astype(np.uint8)[..., None], 3, axis=2))
    return folder / "shot.usda"


def bake(scene: Path, *more: object) -> int:
    folder = scene.parent
    options = ["--rigidity", folder / "rigid.<UDIM>.png", "--out", folder / "out", "--device", "cpu", "--jobs", 1]
    return cli.main([str(argument) for argument in ("bake", scene, *options, *more)])


def maps(scene: Path) -> set[str]:
    """The names of all files, less their frames."""
    found = files(scene.parent / "out")
    names = {re.sub(r"\.000\d", "", name) for name in found}
    # A sequence is whole.
    assert len(found) == len(names) * FRAMES
    return names


@pytest.fixture
def lines(capfd: pytest.CaptureFixture[str]) -> Callable[[], list[str]]:
    return lambda: [line.strip() for line in capfd.readouterr().out.splitlines()]


def test_what_moves_rigidly_gets_no_file(tmp_path: Path, lines: Callable[[], list[str]]) -> None:
    scene = toy(tmp_path, (turns, 0, True), (turns, 1, True))
    report, layer = tmp_path / "report.json", tmp_path / "over.usda"
    options = ("--report", report, "--layer", layer, "--texture", tmp_path / "colour.<UDIM>.png")
    for _ in range(2):
        assert bake(scene, *options, "--strict") == 0
        assert f"{TOY}: nothing gained: all parts move rigidly" in lines()
        assert not (tmp_path / "out").exists() or not files(tmp_path / "out")
    rows = json.loads(report.read_text())["not_baked"]
    assert [(row["mesh"], row["why"], row["meant"]) for row in rows] == [(TOY, gain.RIGIDLY, True)]
    # The layer is there, and changes nothing.
    stage, shot = composed(scene, layer), Usd.Stage.Open(str(scene))
    assert "redirect" not in layer.read_text() and len(list(stage.Traverse())) == len(list(shot.Traverse()))
    # What is named is baked.
    assert bake(scene, "--meshes", "toy") == 0
    assert maps(scene) == {"redirect.1001.exr", "redirect.1002.exr"}


@pytest.mark.parametrize("make", [scenes.materialx_material, scenes.preview_material])
def test_layers_that_gain_nothing_keep_the_material(
    tmp_path: Path, lines: Callable[[], list[str]], make: Callable
) -> None:
    # The second and the fourth layer gain, and only in the last frame; the first one has the other tile, too.
    parts = ((turns, 0, True), (bends, 0, True), (turns, 0, True), (bends, 0, True), (turns, 1, True))
    scene = toy(tmp_path, *parts, make=make)
    layer = tmp_path / "over.usda"
    options = ("--layer", layer, "--texture", tmp_path / "colour.<UDIM>.png")
    assert bake(scene, *options) == 0
    assert f"{TOY}, layers 0,2: nothing gained: all parts move rigidly" in lines()
    kinds = ("redirect_layer1.1001.exr", "redirect_layer3.1001.exr", "colour_layer1.1001.png", "colour_layer3.1001.png")
    assert maps(scene) == set(kinds)
    # A task of one frame, in which nothing moves yet, writes its share; what is up to date stays.
    before = files(tmp_path / "out")
    (tmp_path / "out" / "redirect_layer3.0001.1001.exr").unlink()
    assert bake(scene, "--frames", 1, "--form", "udim", *options[2:]) == 0
    assert "1 file written, 3 up to date" in " ".join(lines())
    assert files(tmp_path / "out") == before
    # Each file that the layer names is there, and each face has the files of its layer or the shot's material.
    stage = composed(scene, layer)
    named = {}
    faces = CELLS * CELLS
    mesh = stage.GetPrimAtPath(TOY)
    for prim in (mesh, *mesh.GetChildren()):
        material = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()[0]
        every = (attribute for node in Usd.PrimRange(material.GetPrim()) for attribute in node.GetAttributes())
        of_files = (attribute for attribute in every if attribute.GetTypeName() == Sdf.ValueTypeNames.Asset)
        assets = {str(attribute.Get(frame).path) for attribute in of_files for frame in (1, FRAMES)}
        named[prim.GetName()] = assets
        for asset in assets - {"colour.<UDIM>.exr", "colour.<UDIM>.png"}:
            assert (tmp_path / asset.replace("<UDIM>", "1001")).is_file(), asset
    assert not any("out" in asset for asset in named["toy"])
    subsets = {child.GetName(): list(UsdGeom.Subset(child).GetIndicesAttr().Get()) for child in mesh.GetChildren()}
    assert subsets == {f"vrtm_layer{layer}": list(range(layer * faces, (layer + 1) * faces)) for layer in (1, 3)}
    assert all(any(f"layer{name[-1]}" in asset for asset in named[name]) for name in subsets)
    told = list(UsdGeom.PrimvarsAPI(mesh).GetPrimvar("vrtmLayer").Get())
    assert told == [layer for layer in (-1, 1, -1, 3, -1) for _ in range(faces)]


def test_subsets_that_gain_nothing_keep_their_material(tmp_path: Path, lines: Callable[[], list[str]]) -> None:
    scene = toy(tmp_path, (turns, 0, True), (bends, 0, True), make=None)
    stage = Usd.Stage.Open(str(scene))
    mesh = stage.GetPrimAtPath(TOY)
    for number, name in enumerate(("still", "soft")):
        faces = list(range(number * CELLS * CELLS, (number + 1) * CELLS * CELLS))
        subset = UsdShade.MaterialBindingAPI.Apply(mesh).CreateMaterialBindSubset(name, faces)
        scenes.bind(subset.GetPrim(), scenes.materialx_material(stage, f"/model/{name}_skin"))
    stage.Save()
    assert bake(scene, "--subsets", "--layer", tmp_path / "over.usda") == 0
    assert f"{TOY} subset still: {gain.RIGIDLY}" in lines()
    assert maps(scene) == {"soft.redirect.1001.exr"}
    composition = composed(scene, tmp_path / "over.usda")
    bound = [
        UsdShade.MaterialBindingAPI(composition.GetPrimAtPath(f"{TOY}/{name}")).ComputeBoundMaterial()[0].GetPath()
        for name in ("still", "soft")
    ]
    assert bound == ["/model/still_skin", "/model/soft_skin_toy_soft_redirected"]


def test_what_has_nothing_rigid_gets_no_file(tmp_path: Path, lines: Callable[[], list[str]]) -> None:
    scene = toy(tmp_path, (bends, 0, False), (bends, 0, True))
    # Both lie in the first layer, side by side, and one of them gains.
    assert bake(scene) == 0 and maps(scene) == {"redirect.1001.exr"}
    scene = toy(tmp_path / "alone", (bends, 0, False))
    assert bake(scene) == 0 and f"{TOY}: {gain.NOTHING}" in lines() and not files(tmp_path / "alone" / "out")
    # What gains is on another surface than what deforms.
    scene = toy(tmp_path / "apart", (bends, 0, False), (turns, 0, True))
    assert bake(scene) == 0 and not files(tmp_path / "apart" / "out")


def test_files_of_an_earlier_bake_are_removed(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    scene = toy(tmp_path, (turns, 0, True))
    out = tmp_path / "out"
    assert bake(scene, "--meshes", "toy") == 0 and len(files(out)) == FRAMES
    # One that was painted on, and one of another mesh, are not vrtm's to remove.
    painted = out / "redirect.0002.1001.exr"
    changed = oiio.ImageBuf(str(painted))
    changed.setpixel(3, 3, (0.5, 0.25, 0))
    changed.write(str(painted))
    capfd.readouterr()
    assert bake(scene) == 0
    assert list(files(out)) == [painted.name]
    assert f"{painted} is left there, although nothing is gained" in capfd.readouterr().err


def test_an_input_is_never_removed(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    scene = toy(tmp_path, (turns, 0, True))
    named = ("--frames", 1, "--name", "<kind>.<UDIM>.exr")
    assert bake(scene, "--meshes", "toy", "--texture", tmp_path / "colour.<UDIM>.png", *named) == 0
    before = files(tmp_path / "out")
    assert set(before) == {"redirect.1001.exr", "colour.1001.png"}
    # A copy of an earlier bake, as a texture.
    assert bake(scene, "--texture", tmp_path / "out" / "colour.<UDIM>.png", *named) == 2
    assert "which is read" in capfd.readouterr().err and files(tmp_path / "out") == before


def test_corner_uvs_have_all_of_a_mesh(tmp_path: Path) -> None:
    scene = toy(tmp_path, (turns, 0, True), (bends, 0, True))
    # Worker processes write no more either.
    assert bake(scene, "--layer", tmp_path / "over.usda", "--layer-mode", "primvar", "--jobs", 2) == 0
    assert maps(scene) == {"redirect_layer1.1001.exr", "corners.usdc"}
    stage = composed(scene, tmp_path / "over.usda")
    mesh = stage.GetPrimAtPath(TOY)
    uvs = np.array(UsdGeom.PrimvarsAPI(mesh).GetPrimvar("st_redirected").Get(FRAMES))
    own = np.array(UsdGeom.PrimvarsAPI(mesh).GetPrimvar("st").Get())[mesh.GetAttribute("faceVertexIndices").Get()]
    half = len(uvs) // 2
    assert abs(uvs[:half] - own[:half]).max() < 1e-6 < 1e-3 < abs(uvs[half:] - own[half:]).max()


def shape(points: list, counts: list[int], faces: list[int]) -> Shape:
    rest = np.array(points, np.float32)
    uvs = np.full((1, 2), 0.5, np.float32)
    return Shape("a", "/a", rest, np.array(counts), np.array(faces), uvs, np.zeros(len(faces), np.int32), "st")


def test_lengths_tell_what_deforms() -> None:
    square = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    made = shape(square, [4], [0, 1, 2, 3])
    lengths = gain._Lengths(made, np.zeros(1, int), {0})

    def deforms(points: object) -> bool:
        return any(lengths.deforming(np.array(points, np.float32)))

    assert not deforms(turns(made.rest, 2)) and not deforms(made.rest * [-1, 1, 1])
    # Edges keep their lengths when a square is sheared, and either diagonal when it is folded.
    assert deforms([(0, 0, 0), (1, 0, 0), (1.6, 0.8, 0), (0.6, 0.8, 0)])
    half = np.sqrt(0.5)
    centre, up = np.array([0.5, 0.5, 0]), np.array([0, 0, half])
    for corner in range(4):
        folded = made.rest.copy()
        folded[corner] = centre + up
        assert deforms(folded)
    assert deforms(made.rest * 1.001) and deforms(np.where(made.rest == 1, np.nan, made.rest))
    # Far away the coordinates have few digits, but a stretch of a tenth is one.
    far = made.rest + np.float32(4e5)
    lengths = gain._Lengths(shape(far.tolist(), [4], [0, 1, 2, 3]), np.zeros(1, int), {0})
    assert not deforms(far) and deforms(far + made.rest * [0.5, 0, 0])


def test_surfaces_are_what_hangs_together() -> None:
    points = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (5, 5, 5), (6, 5, 5), (5, 6, 5), (0, 1, 0)]
    made = shape(points, [3, 0, 3, 3], [0, 1, 2, 3, 4, 5, 5, 4, 6])
    first, _, second, third = gain._shells(made, "index")
    assert first != second == third
    first, _, second, third = gain._shells(made, "position")
    assert first == second == third


def test_charts_end_where_uvs_do() -> None:
    # A strip of three squares that share their vertices: the UVs of the second go on in the third, nearly.
    points = [(x, y, 0) for x in range(4) for y in range(2)]
    faces = [2 * x + corner for x in range(3) for corner in (0, 2, 3, 1)]
    made = shape(points, [4] * 3, faces)
    shifts = ((0, 0.5), (1, 0), (2, 3e-4))
    uvs = [(0.1 * (x + a) + by, 0.1 * b) for x, by in shifts for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))]
    made = dataclasses.replace(made, uvs=np.array(uvs), uv_indices=np.arange(12, dtype=np.int32))
    assert len(set(gain._shells(made, "index"))) == 1
    first, second, third = gain._shells(made, "index", charts=True)
    assert first != second == third


def test_poses_that_cannot_be_read_count_as_deformed(tmp_path: Path) -> None:
    scene = toy(tmp_path, (turns, 0, True))
    stage = Usd.Stage.Open(str(scene))
    points = stage.GetPrimAtPath(TOY).GetAttribute("points")
    points.Set(points.Get(2)[:-1], 2)
    stage.Save()
    assert bake(scene, "--frames", 1) == 0 and len(files(tmp_path / "out")) == 1


def test_a_line_for_each_mesh(tmp_path: Path, lines: Callable[[], list[str]]) -> None:
    report = tmp_path / "report.json"
    scene = toy(tmp_path, (bends, 0, True))
    assert bake(scene, "--report", report) == 0
    (line,) = [line for line in lines() if line.startswith(f"{TOY}: {FRAMES} frames")]
    told = re.fullmatch(
        rf"{TOY}: 3 frames \(1-3\), strain ([\d.]+) -> ([\d.]+) RMS \(frame 3, the worst: ([\d.]+) -> ([\d.]+)\), "
        r"[\d.]+% fixed, 3 files written, [\d.]+ s",
        line,
    )
    before, after, worst_before, worst_after = map(float, told.groups())
    assert after < before < worst_before and after < worst_after < worst_before
    (mesh,) = json.loads(report.read_text())["meshes"]
    assert mesh["strain"]["worst"]["frame"] == FRAMES and mesh["strain"]["frames"] == [1, 2, 3]
    # What is up to date has kept its figures only if they were measured; and files do not depend on the task.
    before_files = files(tmp_path / "out")
    assert bake(scene) == 0 and "strain not measured" in " ".join(lines())
    (tmp_path / "out" / "redirect.0003.1001.exr").unlink()
    assert bake(scene, "--frames", 3) == 0 and files(tmp_path / "out") == before_files
    # What is named and gains nothing says so.
    scene = toy(tmp_path / "rigid", (turns, 0, True))
    assert bake(scene, "--meshes", "toy") == 0
    assert any(line.startswith(f"{TOY}: 3 frames (1-3), no strain in 3 measured frames, ") for line in lines())


@pytest.fixture
def crowded(tmp_path: Path) -> Path:
    """A sheet that is crowded with 8 x 8 squares, and whose left half shrinks in the second of two frames."""
    stage = scenes.stage(tmp_path / "shot.usda", 1, 2)
    rest, faces = grid(16)
    poses = {frame: rest - [0.25 * (frame - 1), 0, 0] * np.minimum(2 * rest, 1) for frame in (1, 2)}
    scenes.mesh(stage, "/model/skin", rest, rest[:, :2], faces=faces, poses=poses, pref=True)
    stage.Save()
    y, x = np.mgrid[:64, :64] % 8
    row = np.arange(512) % 64 == 30
    image(tmp_path / "1.png", np.where(row[:, None] & row, 255, 0).astype(np.uint8)[..., None])
    flat(tmp_path / "0.png", 0)
    for value in (255, 127, 102):
        image(tmp_path / f"{value}.png", np.where((x > 1) & (y > 1), value, 0).astype(np.uint8)[..., None])
    return tmp_path / "shot.usda"


def bake_crowded(crowded: Path, *more: object, value: int = 255, expect: int = 0):
    rigidity, out = crowded.parent / f"{value}.png", crowded.parent / f"out{value}"
    options = ("--size", 64, "--seams", "shut", "--device", "cpu", "--jobs", 1, "--report", crowded.parent / "r.json")
    return run("bake", crowded, "--rigidity", rigidity, "--out", out, *options, *more, expect=expect)


def test_features_that_are_worse_are_told_and_limited(crowded: Path) -> None:
    ended = bake_crowded(crowded, "--measure")
    report = json.loads((crowded.parent / "r.json").read_text())
    still, shrunk = (frame["tiles"][0]["features"] for frame in report["frames"])
    assert still["count"] == shrunk["count"] == 64
    assert (still["worse"], still["worst"], still["strained"]) == (0, [], {"before": 0, "after": 0})
    count, worst = shrunk["worse"], shrunk["worst"][0]
    assert 0 < count <= 32 and len(shrunk["worst"]) == min(count, 16) and shrunk["strained"]["before"] == 32
    # In the half that keeps its shape.
    assert worst["u"] > 0.5 and worst["before"] < 1e-3 and worst["after"] > 0.02
    (mesh,) = report["meshes"]
    assert mesh["features"] == {"count": 64, "worse": count, "frame": 2, "worst": {"frame": 2} | worst}
    line = rf"{count} of 64 features are worse than without vrtm in frame 2: the worst at UV [\d.]+, [\d.]+: "
    assert re.search(line + r"[\d.e-]+ -> [\d.]+ RMS, frame 2, ", ended.stdout)
    assert bake_crowded(crowded, "--max-worse", count).returncode == 0
    ended = bake_crowded(crowded, "--max-worse", count - 1, expect=3)
    assert f"--max-worse {count - 1} was exceeded in 1 of 2: skin, frame 2, tile 1001: " in ended.stderr
    assert f"worse than without vrtm: {count}, the worst at UV" in ended.stderr
    assert "--max-worse" in bake_crowded(crowded, "--max-worse", -1, expect=2).stderr


@pytest.mark.parametrize("value", [127, 102])
def test_grey_paint_is_measured_and_told_if_it_is_fixed(crowded: Path, value: int) -> None:
    ended = bake_crowded(crowded, "--max-strain", 0.01, value=value, expect=3)
    assert "nothing gained" not in ended.stdout and "--max-strain 0.01 was exceeded in 1 of 2" in ended.stderr
    tile = json.loads((crowded.parent / "r.json").read_text())["frames"][1]["tiles"][0]
    assert 0.01 < tile["strain"]["after"]["rms"] < tile["strain"]["before"]["rms"]
    assert tile["features"]["count"] == 64
    mask = flat(crowded.parent / "mask.png", 0)
    ended = bake_crowded(crowded, "--mask", mask, "--max-strain", 0.9, value=value, expect=3)
    assert "cannot be met in 2 of 2: skin, frame 1, tile 1001: 100.0% of the rigid segments are fixed" in ended.stderr


@pytest.mark.parametrize("limit", [("--max-strain", 0.9), ("--max-worse", 9)])
def test_a_limit_is_not_kept_where_nothing_was_measured(crowded: Path, limit: tuple) -> None:
    # Dots that are too small for two nodes of the grid.
    for _ in range(2):
        ended = bake_crowded(crowded, *limit, value=1, expect=3)
        assert f"{limit[0]} could not be checked in 2 places: skin, frame 1, tile 1001: the painted" in ended.stderr
        assert "nothing gained" not in ended.stdout and "strain not measured: the painted" in ended.stdout
        tile = json.loads((crowded.parent / "r.json").read_text())["frames"][1]["tiles"][0]
        assert tile["strain"]["unmeasured"] and tile["max_displacement"] > 0
    # Where nothing is rigid there is nothing to measure.
    assert "nothing is rigid" in bake_crowded(crowded, *limit, "--meshes", "skin", value=0).stdout
    layer = ("--layer", crowded.parent / "over.usda", "--only-layer")
    said = bake_crowded(crowded, *limit, *layer, value=1, expect=None).stderr
    assert f"--only-layer solves nothing: {limit[0]} cannot be checked" in said
