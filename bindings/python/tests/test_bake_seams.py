"""`vrtm bake --seams continue`: features keep their shape across seams, and copies of textures show what lies there;
and the choices of a bake where --seams and --open-borders are not given."""

import functools
import json
import pickle
import shutil
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from unittest import mock

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdGeom

import scenes
from bake_scenes import files, image, opened, pixels, run, sheet_arguments, with_material
from conftest import centres, grid
from vrtm.bake import borders
from vrtm.bake.neighbours import World
from vrtm.bake.scene import SceneOptions
from vrtm.bake.work import Work
from vrtm.borders import kept_or_shut

CELLS = 24
SIZE = 256


def write_obj(path: Path, pose: bool, amount: float = 0.12, stretch: float = 0) -> Path:
    """`amount`: how far the pose moves the seam's surroundings across it; `stretch`: of the middle of the seam."""
    (points, faces), right = grid(CELLS), np.repeat(np.tile(np.arange(CELLS) >= CELLS // 2, CELLS), 4)
    x, y, z = (points * [2, 1, 1]).T
    corners = np.stack([x, y], -1)[faces.reshape(-1)]
    uvs = np.stack([0.1 + 0.8 * (corners[:, 0] - right) + right, 0.1 + 0.8 * corners[:, 1]], -1)
    if pose:
        z = 0.1 * np.sin(2 * y)
        x, y = x + amount * np.sin(np.pi * x), y - stretch * np.sin(2 * np.pi * y) / (2 * np.pi)
    lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in zip(x, y, z)] + [f"vt {u:.6f} {v:.6f}" for u, v in uvs]
    for number, face in enumerate(faces):
        lines.append("f " + " ".join(f"{vertex + 1}/{4 * number + k + 1}" for k, vertex in enumerate(face)))
    path.write_text("\n".join(lines) + "\n")
    return path


def on_sheet(tile: int) -> tuple[np.ndarray, np.ndarray]:
    u, v = centres(SIZE)
    return (u - 0.1) / 0.8 + tile, (v - 0.1) / 0.8


def paint(folder: Path, kind: str, of: Callable, beside: tuple[float, ...] | None = None) -> None:
    """Writes the images of both tiles. `of`: texels at x and y of the sheet; True where it is rigid, or colours, with
    the one beside the charts."""
    for tile in range(2):
        x, y = on_sheet(tile)
        texels = of(x, y)
        if beside is None:
            texels = (255 * texels).astype(np.uint8)[..., None]
        else:
            inside = (x >= tile) & (x <= tile + 1) & (y >= 0) & (y <= 1)
            texels = np.rint(65535 * np.where(inside[..., None], texels, beside)).astype(np.uint16)
        image(folder / f"{kind}.{1001 + tile}.png", texels)


def content(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return np.stack([0.2 + 0.3 * x, 0.2 + 0.6 * y, 0.3 + 0.2 * np.sin(20 * x)], axis=-1)


@pytest.fixture
def scene(tmp_path: Path) -> list[object]:
    """The arguments of a bake of a sheet with a rigid disc in the middle, over the seam, and a texture with a colour of
    its own beside the charts."""
    paint(tmp_path, "rigid", lambda x, y: np.hypot(x - 1, y - 0.5) < 0.1)
    paint(tmp_path, "colour", content, (1, 0, 1))
    rest, pose = write_obj(tmp_path / "rest.obj", False), write_obj(tmp_path / "pose.obj", True)
    maps = ["--rigidity", tmp_path / "rigid.<UDIM>.png", "--texture", tmp_path / "colour.<UDIM>.png"]
    return ["bake", rest, "--poses", pose, *maps]


def test_both_sides_of_a_seam_show_the_same(scene: list[object], tmp_path: Path) -> None:
    normal = [0.36, 0.48, 0.8]
    paint(tmp_path, "bumps", lambda x, y: (np.array(normal) + 1) / 2, (0.5, 0.5, 1))
    bumps = ("--normal-map", tmp_path / "bumps.<UDIM>.png")
    arguments = [*scene, "--seams", "continue", *bumps, "--out", tmp_path / "out"]
    run(*arguments)
    column, rows = round(0.9 * SIZE), slice(int(0.15 * SIZE), int(0.85 * SIZE))

    def at_seam(kind: str) -> list[np.ndarray]:
        """The texels on either side of the seam."""
        found = (pixels(next((tmp_path / "out").glob(f"*{kind}*{1001 + tile}*"))) for tile in range(2))
        return [of[rows, at] / 65535 for of, at in zip(found, (column - 1, SIZE - column))]

    # Something moves there, and no colour from beside the charts gets in.
    redirection = pixels(next((tmp_path / "out").glob("*redirect*1001*")))
    own = (np.arange(SIZE) + 0.5)[None, :] / SIZE
    moved = SIZE * np.abs(redirection[rows, :, 0] - own)[:, column - 2 : column]
    assert moved.max() > 0.3, moved.max()
    before, after = at_seam("colour")
    assert before[:, 1].min() > 0.15 and after[:, 1].min() > 0.15
    # A texel is 0.3 / (0.8 * SIZE) wide in the first channel.
    assert np.abs(after - before)[:, :2].max() < 0.012, np.abs(after - before).max(axis=0)
    # The warp turns normals a little, on both sides alike.
    before, after = (2 * of - 1 for of in at_seam("bumps"))
    assert np.abs(before - after).max() < 0.08
    assert np.abs(before[:, 2] - normal[2]).max() < 0.01 and np.abs(before - normal).max() < 0.1
    # Files depend on the maps of other tiles.
    old = files(tmp_path / "out")
    image(tmp_path / "rigid.1002.png", np.zeros((SIZE, SIZE, 1), np.uint8))
    run(*arguments)
    new = files(tmp_path / "out")
    first = [name for name in old if "redirect" in name and "1001" in name]
    assert first and all(new[name] != old[name] for name in first)


def test_textures_slide_along_open_borders(scene: list[object], tmp_path: Path) -> None:
    paint(tmp_path, "rigid", lambda x, y: (x >= 0) & (y >= 0) & (np.hypot(x - 0.5, y) < 0.15))
    deltas = []
    for open_borders in ("fixed", "slide"):
        out = tmp_path / open_borders
        run(*scene, "--open-borders", open_borders, "--form", "delta", "--out", out)
        delta = SIZE * pixels(next(out.glob("*redirect*1001*")))[round(0.9 * SIZE) - 1]
        deltas.append(np.abs(delta).max(axis=0))
    # In texels, of the row of texels at the lower border.
    assert deltas[0].max() < 0.5, deltas
    assert deltas[1][0] > 1 and deltas[1][1] < 0.2, deltas


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
    paint(tmp_path, "rigid", lambda x, y: (np.abs(x - 1) < 0.2) & (np.abs(y - 0.5) < 0.3))
    (tmp_path / "colour.1002.png").unlink()
    strain = {}
    for seams in ("shut", "keep"):
        report, options = tmp_path / f"{seams}.json", ("--seams", seams, "--open-borders", "fixed", "--measure")
        baked(scene, tmp_path / seams, *options, "--report", report)
        tiles = next(row for row in json.loads(report.read_text())["frames"] if row["frame"] == 2)["tiles"]
        strain[seams] = tiles[0]["strain"]["after"]["rms"]
    # Both tiles are alike, and so are both features, which are strained with either.
    assert strain["shut"] < strain["keep"]
    best = "shut"
    said, found = baked(scene, tmp_path / "out", "--measure")
    lacks = f"{tmp_path / 'colour.<UDIM>.png'} has no file of tile 1002; in frame 2 "
    both = "2 of 2 features are strained and 0 worse than without vrtm if"
    why = f"{both} shut (strain {strain['shut']:.4f}), {both} kept (strain {strain['keep']:.4f})"
    assert line(said) == f"seams {best}, open borders fixed: {lacks}{why}"
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
    paint(tmp_path, "rigid", lambda x, y: np.hypot(np.abs(x - 1) - 0.5, y - 0.5) < 0.1)
    with mock.patch.object(borders, "_kept_or_shut", None):
        said, _ = baked(scene, tmp_path / "none")
    assert line(said).startswith("seams shut, open borders fixed: ")


@pytest.mark.parametrize(
    "shut, keep, better",
    [
        # Of 40 features: those that are strained, those that are worse, and the strain.
        ((4, 0, 0.09), (4, 0, 0.2), "shut"),
        ((4, 0, 0.2), (4, 0, 0.09), "keep"),
        # A few that are a little beyond a limit decide nothing.
        ((8, 0, 0.06), (4, 0, 0.2), "shut"),
        ((9, 0, 0.06), (4, 0, 0.2), "keep"),
        ((4, 6, 0.06), (4, 0, 0.2), "keep"),
        ((0, 0, 0.0), (0, 0, 0.0), "shut"),
    ],
)
def test_features_decide_between_keep_and_shut(shut: tuple, keep: tuple, better: str) -> None:
    def report(strained: int, worse: int, strain: float) -> SimpleNamespace:
        known = {"features": 40, "features_strained_after": strained, "features_worse": worse}
        # Four edges of a thousand are harmed where seams are shut.
        edges = {"segments": 1000, "segments_fixed": 0, "strain_fixed": 0.0, "harm": 0.004 * (strain != keep[2])}
        return SimpleNamespace(**known, **edges, after=SimpleNamespace(rms=strain))

    found, told = kept_or_shut(lambda seams: [report(*(shut if seams == "shut" else keep))])
    assert found == better and f"{shut[0]} of 40 features are strained and {shut[1]} worse" in told


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


def open_borders(scene: Path, meshes: tuple[str, ...] = ()) -> set[str]:
    """The choices for the meshes of a scene, all of whose textures are copies."""
    colour = image(scene.parent / "colour.png", np.zeros((16, 16, 3), np.uint8))
    with opened(scene, SceneOptions(meshes=meshes), textures=(str(colour),)) as work:
        return {mesh.borders.open_borders for mesh in work.meshes.values()}


@pytest.mark.parametrize(
    "own, place, more, slides",
    [
        # Of the other mesh: by how much its points are shifted in its own space, and from there to the world.
        ((0, 0, 0), (0, 1, 0), "", False),
        ((0, 9, 0), (0, -8, 0), "", False),
        ((0, 0, 0), (0, 9, 0), "", True),
        ((0, 1, 0), (0, 9, 0), "", True),
        ((0, 0, 0), (0, 1, 0), "small", False),
        ((0, 1, 0), (0, 0, 0), "moved", False),
        ((0, 0, 0), (0, 1, 0), "unnamed", False),
        ((0, 0, 0), (0, 1, 0), "without UVs", False),
        ((0, 0, 0), (0, 1, 0), "hidden", True),
        ((0, 0, 0), (0, 9, 0), "instances", False),
    ],
)
def test_meshes_meet_in_the_world(tmp_path: Path, own: tuple, place: tuple, more: str, slides: bool) -> None:
    stage = scenes.stage(tmp_path / "shot.usda", 1, 2)
    scale = 0.01 if more == "small" else 1
    for name in ("body", "head"):
        points = np.float32(scenes.POINTS) + (np.float32(own) if name == "head" else 0)
        poses = {1: points / scale, 2: points * [1.1, 1, 1] / scale} if name == "head" else {1: points, 2: 1.1 * points}
        uvs = None if (name, more) == ("head", "without UVs") else scenes.UVS
        scenes.mesh(stage, f"/{name}/{name}", poses[1], uvs, poses=poses)
    above = UsdGeom.Xformable(UsdGeom.Xform.Define(stage, "/head"))
    above.AddTranslateOp().Set(place)
    above.AddScaleOp().Set((scale,) * 3)
    if more == "moved":
        above.GetTranslateOp().Set((5, 0, 0), 2)
        above.GetTranslateOp().Set(place, 1)
    elif more == "hidden":
        UsdGeom.Imageable(above).MakeInvisible()
    elif more == "instances":
        above.GetPrim().SetSpecifier(Sdf.SpecifierClass)
        for number, height in enumerate((20, 1)):
            other = scenes.instance(stage, f"/other{number}", "/head")
            UsdGeom.XformCommonAPI(other).SetTranslate((0, height, 0))
    stage.Save()
    named = ("body",) if more == "unnamed" else ()
    assert open_borders(tmp_path / "shot.usda", named) == {"slide" if slides else "fixed"}


def test_points_meet_on_all_sides() -> None:
    for side in np.ndindex(2, 2, 2):
        assert World(np.zeros((1, 3))).meets(World(1.8 * np.array([side]) - 0.9), 1.0)


def test_meshes_of_alembic_meet_in_the_world(tmp_path: Path) -> None:
    abc = pytest.importorskip("alembic_scenes")

    def author(archive, model) -> None:
        for name, height in (("body", 0), ("head", 9)):
            points, above = np.add(scenes.POINTS, (0, height, 0)), np.eye(4)
            above[3, 1] = -8 * (name == "head")
            poses, faces = [points, points * 1.1], scenes.INDICES
            abc.mesh(abc.placed(model, name, [above]), name, poses, faces, abc.sampled(archive), scenes.UVS)

    path = abc.write(tmp_path / "shot.abc", author)
    assert open_borders(path) == open_borders(path, ("body",)) == {"fixed"}


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
