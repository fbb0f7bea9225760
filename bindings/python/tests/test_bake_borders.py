"""Choices of `vrtm bake` at borders where --seams and --open-borders are not given."""

import functools
import json
import pickle
import shutil
from pathlib import Path
from unittest import mock

import numpy as np
from pxr import Sdf, Usd

import scenes
import test_bake_seams
from bake_scenes import files, image, opened, run, sheet_arguments, with_material
from test_bake_seams import CELLS, on_sheet, write_obj
from vrtm.bake import borders
from vrtm.bake.scene import SceneOptions
from vrtm.bake.work import Work

scene = test_bake_seams.scene
COPIED = "rest.obj: seams continue, open borders slide: all textures are copies"


def baked(scene: list[object], out: Path, *more: object) -> tuple[str, dict[str, bytes]]:
    """Output of a bake, and its files."""
    said = run(*scene, "--size", 64, "--device", "cpu", "--jobs", 1, "--out", out, *more).stdout
    return said, files(out)


def line(said: str) -> str:
    """Printed line about borders, less the mesh's path."""
    found = [line for line in said.splitlines() if ": seams " in line]
    assert len(found) == 1, said
    return found[0].partition(": ")[2]


def test_textures_that_are_copied_go_on(scene: list[object], tmp_path: Path) -> None:
    report = tmp_path / "report.json"
    said, found = baked(scene, tmp_path / "out", "--report", report)
    assert COPIED in said
    told = {"seams": "continue", "open_borders": "slide", "why": "all textures are copies"}
    assert json.loads(report.read_text())["meshes"][0]["borders"] == told
    explicit = ("--seams", "continue", "--open-borders", "slide")
    said, expected = baked(scene, tmp_path / "explicit", *explicit)
    assert found == expected and ": seams " not in said
    # What is given is obeyed, and the other is still chosen.
    said, _ = baked(scene, tmp_path / "out", "--seams", "keep", "--dry-run")
    assert line(said) == "seams keep, open borders slide: all textures are copies"
    said, _ = baked(scene, tmp_path / "out", "--open-borders", "fixed", "--dry-run")
    assert line(said) == "seams continue, open borders fixed: all textures are copies"
    # Without a texture nothing is known.
    said, maps = baked(scene[:-2], tmp_path / "maps")
    assert line(said).startswith("seams shut, open borders fixed: not all textures are known")
    assert maps == baked(scene[:-2], tmp_path / "shut", "--seams", "shut", "--open-borders", "fixed")[1]


def test_the_better_one_where_a_texture_has_no_copy(scene: list[object], tmp_path: Path) -> None:
    for number, stretch in ((1, 0.1), (2, 0.9)):
        write_obj(tmp_path / f"pose.{number}.obj", True, 0.02, stretch)
    scene[3] = tmp_path / "pose.#.obj"
    # A large feature on the seam: if that is shut, it becomes an hourglass.
    for tile in range(2):
        x, y = on_sheet(tile)
        rigid = (np.abs(x - 1) < 0.2) & (np.abs(y - 0.5) < 0.3)
        image(tmp_path / f"rigid.{1001 + tile}.png", np.where(rigid, 255, 0).astype(np.uint8)[..., None])
    (tmp_path / "colour.1002.png").unlink()
    harmed = {}
    for seams in ("shut", "keep"):
        report, options = tmp_path / f"{seams}.json", ("--seams", seams, "--open-borders", "fixed", "--measure")
        baked(scene, tmp_path / seams, *options, "--report", report)
        tiles = next(row for row in json.loads(report.read_text())["frames"] if row["frame"] == 2)["tiles"]
        movable = [tile["strain"]["movable"] for tile in tiles]
        harmed[seams] = sum(round(own["harm"] * own["segments"]) for own in movable)
    assert harmed["shut"] != harmed["keep"]
    best = min(harmed, key=lambda seams: harmed[seams])
    said, found = baked(scene, tmp_path / "out", "--measure")
    why = f"rigid edges are strained by over a quarter more if shut, {harmed['keep']} if kept"
    lacks = f"{tmp_path / 'colour.<UDIM>.png'} has no file of tile 1002; in frame 2 {harmed['shut']}"
    assert line(said) == f"seams {best}, open borders fixed: {lacks} {why}"
    assert found == files(tmp_path / best)
    # Whatever a task bakes of it, it chooses the same: all is up to date.
    for part in (("--frames", 1), ("--tiles", 1001), ("--frames", 2, "--tiles", 1002)):
        said, after = baked(scene, tmp_path / "out", "--measure", *part)
        assert "\n0 files written" in said and after == found
    # So does a further process, which is told.
    options = SceneOptions(poses=(str(tmp_path / "pose.#.obj"),))
    maps = {"rigidity": str(tmp_path / "rigid.<UDIM>.png"), "textures": (str(tmp_path / "colour.<UDIM>.png"),)}
    with (
        opened(tmp_path / "rest.obj", options, size=64, out=str(tmp_path / "out"), **maps) as work,
        mock.patch.object(borders, "mesh", None),
    ):
        with Work(work.settings, 1, pickle.loads(pickle.dumps(work.choices))) as other:
            (mesh,) = other.meshes.values()
            assert (mesh.settings.seams, mesh.borders) == (best, next(iter(work.meshes.values())).borders)
    # Where nothing rigid is on a border there is nothing to choose, and nothing to solve.
    for udim in (1001, 1002):
        x, y = on_sheet(udim - 1001)
        disc = np.hypot(x - (0.5 if udim == 1001 else 1.5), y - 0.5) < 0.1
        image(tmp_path / f"rigid.{udim}.png", np.where(disc, 255, 0).astype(np.uint8)[..., None])
    with mock.patch.object(borders, "_kept_or_shut", None):
        said, _ = baked(scene, tmp_path / "none")
    assert line(said).startswith("seams shut, open borders fixed: ")


def test_nothing_slides_where_the_surface_goes_on(scene: list[object], tmp_path: Path) -> None:
    # Each face has vertices of its own.
    for name in ("rest.obj", "pose.obj"):
        lines = (tmp_path / name).read_text().splitlines()
        points, uvs, faces = ([line for line in lines if line.startswith(kind)] for kind in ("v ", "vt ", "f "))
        corners = [corner.split("/") for face in faces for corner in face.split()[1:]]
        doubled = [points[int(vertex) - 1] for vertex, _ in corners]
        numbered = [f"{number}/{uv}" for number, (_, uv) in enumerate(corners, 1)]
        faces = ["f " + " ".join(numbered[k : k + 4]) for k in range(0, 4 * CELLS * CELLS, 4)]
        (tmp_path / name).write_text("\n".join([*doubled, *uvs, *faces]) + "\n")
    said, _ = baked(scene, tmp_path / "out", "--dry-run")
    assert line(said).startswith("seams continue, open borders fixed: all textures are copies, and other vertices are")
    said, _ = baked(scene, tmp_path / "out", "--dry-run", "--weld", "position")
    assert COPIED in said


def test_textures_that_are_looked_up_have_to_be_dilated(tmp_path: Path) -> None:
    shot = with_material(tmp_path / "shot")
    for udim in (1001, 1002):
        image(tmp_path / "shot" / f"colour.{udim}.exr", np.full((16, 16, 3), 0.5, np.float32))
    colour = tmp_path / "shot" / "colour.<UDIM>.exr"

    def said(*more: object) -> str:
        return line(run(*sheet_arguments(shot, tmp_path / "out", "--dry-run", *more)).stdout)

    undilated = f"{tmp_path / 'shot' / 'colour.1001.exr'} is looked up, and is not dilated"
    # Also in a task that does not write the layer.
    for more in ((), ("--texture", colour), ("--texture", colour, "--layer", tmp_path / "over.usda")):
        assert said(*more).startswith(f"seams shut, open borders fixed: {undilated}; if keep is better, ")
    run("dilate", shot, "--texture", colour, "--out", tmp_path / "dilated", "--reach", 0.04)
    for udim in (1001, 1002):
        shutil.copy(tmp_path / "dilated" / f"colour.{udim}.exr", tmp_path / "shot")
    assert said() == "seams continue, open borders slide: all textures are copies or dilated"
    assert said("--seam-reach", 0.1).startswith(f"seams shut, open borders fixed: {undilated}")


def test_meshes_are_chosen_for_one_by_one(tmp_path: Path) -> None:
    """One has a texture of MaterialX, the other one of UsdPreviewSurface, which copies replace."""
    shot = with_material(tmp_path / "shot", functools.partial(scenes.preview_material, texture="colour.<UDIM>.png"))
    stage = Usd.Stage.Open(str(shot))
    other = stage.DefinePrim("/model/other")
    Sdf.CopySpec(stage.GetRootLayer(), "/model/sheet", stage.GetRootLayer(), other.GetPath())
    scenes.bind(other, scenes.materialx_material(stage, "/model/looked_up"))
    # Not in the same place.
    for attribute in ("points", "primvars:Pref"):
        points = other.GetAttribute(attribute)
        for time in (Usd.TimeCode.Default(), *points.GetTimeSamples()):
            points.Set(np.array(points.Get(time)) + np.float32([9, 0, 0]), time)
    stage.Save()
    arguments = sheet_arguments(shot, tmp_path / "out", "--texture", tmp_path / "shot" / "colour.<UDIM>.png")
    said = run(*arguments, "--dry-run").stdout.splitlines()
    assert "/model/sheet: seams continue, open borders slide: all textures are copies" in said
    other = "/model/other: seams shut, open borders fixed: colour.<UDIM>.exr is looked up, and is not dilated"
    assert any(line.startswith(other) for line in said)
