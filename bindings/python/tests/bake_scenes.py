"""The console command in tests, and a small scene with two tiles for it."""

import contextlib
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import TextIO
from unittest import mock

import numpy as np
import OpenImageIO as oiio
from pxr import Sdf, Usd, UsdGeom

import scenes
import vrtm
from conftest import centres, grid
from vrtm.bake import warped
from vrtm.bake.scene import Scene, SceneOptions, Shape
from vrtm.bake.scene.images import read_map
from vrtm.bake.settings import Settings
from vrtm.bake.work import Work
from vrtm.cli import main

# Where the package is that these tests are of: among the installed ones, or the sources.
INSTALLED = Path(vrtm.__file__).resolve().parents[1]
# The mesh of `sheet`.
MESH = "/model/sheet"


def vrtm_command(*arguments: object, **environment: str) -> tuple[list[str], dict[str, str]]:
    """The console command as a subprocess has to be called, and its environment."""
    kept = {name: value for name, value in os.environ.items() if name not in ("VRTM_DEVICE", "VRTM_THREADS")}
    path = os.pathsep.join(filter(None, [str(INSTALLED), os.environ.get("PYTHONPATH")]))
    return [sys.executable, "-m", "vrtm.cli", *map(str, arguments)], kept | {"PYTHONPATH": path} | environment


def processes() -> dict[int, tuple[str, int, int]]:
    """The state, the parent and the session of each process; /proc tells."""
    found = {}
    for entry in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            state, parent, _, session = (entry / "stat").read_text().rsplit(")", 1)[1].split()[:4]
            found[int(entry.name)] = state, int(parent), int(session)
    return found


@contextlib.contextmanager
def _caught(name: str) -> Iterator[TextIO]:
    """A file that gets what is written to a standard stream in the block, by Python and by libraries."""
    before = getattr(sys, name)
    before.flush()
    descriptor = {"stdout": 1, "stderr": 2}[name]
    kept = os.dup(descriptor)
    with tempfile.TemporaryFile("w+", encoding="utf-8", errors="backslashreplace") as file:
        os.dup2(file.fileno(), descriptor)
        setattr(sys, name, file)
        try:
            yield file
        finally:
            setattr(sys, name, before)
            os.dup2(kept, descriptor)
            os.close(kept)


def run(*arguments: object, expect: int | None = 0, **environment: str) -> subprocess.CompletedProcess[str]:
    """Runs the console command to its end, and expects an exit code: in this process, which saves the start of Python
    and its modules, unless it is to have variables of its own."""
    command, variables = vrtm_command(*arguments, **environment)
    if environment:
        ended = subprocess.run(command, env=variables, capture_output=True, text=True, timeout=300)
    else:
        ended = _run_here(command[3:], variables)
    if expect is not None:
        assert ended.returncode == expect, f"{ended.returncode}: {ended.stdout[-2000:]}{ended.stderr[-2000:]}"
    return ended


def _run_here(arguments: list[str], variables: dict[str, str]) -> subprocess.CompletedProcess[str]:
    # A process of its own would know no textures yet.
    warped.read.cache_clear()
    warped.extension.cache_clear()
    with (
        _caught("stdout") as out,
        _caught("stderr") as err,
        mock.patch.object(sys, "argv", ["vrtm", *arguments]),
        mock.patch.dict(os.environ, variables, clear=True),
    ):
        try:
            code = main()
        except SystemExit as ended:
            code = ended.code
        told = []
        for file in (out, err):
            file.seek(0)
            told.append(file.read())
    return subprocess.CompletedProcess(arguments, code, *told)


def files(folder: Path) -> dict[str, bytes]:
    """All files below a folder, hidden ones, too."""
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def image(path: Path, pixels: np.ndarray, **attributes: object) -> Path:
    """Writes (height, width, channels) pixels as they are. `attributes`: also fields of the specification."""
    kinds = {"float16": "half", "float32": "float", "float64": "double"}
    kind = kinds.get(str(pixels.dtype), str(pixels.dtype))
    spec = oiio.ImageSpec(pixels.shape[1], pixels.shape[0], pixels.shape[2], kind)
    for name, value in attributes.items():
        setattr(spec, name, value) if hasattr(spec, name) else spec.attribute(name, value)
    out = oiio.ImageOutput.create(str(path))
    assert out.open(str(path), spec) and out.write_image(pixels) and out.close(), out.geterror()
    return path


def flat(path: Path, value: int = 255, size: int = 16) -> Path:
    """Writes a square image of one channel and one value of 8 bits: of 255, all is rigid."""
    return image(path, np.full((size, size, 1), value, np.uint8))


def pixels(path: Path, level: int = 0) -> np.ndarray:
    """(height, width, channels) as they are stored. `level`: of the mip levels of a tiled texture."""
    config = oiio.ImageSpec()
    config.attribute("oiio:UnassociatedAlpha", 1)
    file = oiio.ImageInput.open(str(path), config)
    assert file is not None and file.seek_subimage(0, level), oiio.geterror()
    spec = file.spec()
    assert level == 0 or spec.tile_width
    pixels = file.read_image(0, level, 0, spec.nchannels, spec.format)
    return np.asarray(pixels).reshape(spec.height, spec.width, spec.nchannels)


def attributes(path: Path) -> dict[str, object]:
    """All attributes of an image."""
    return {a.name: a.value for a in oiio.ImageInput.open(str(path)).spec().extra_attribs}


def sheet(folder: Path, frames: int = 5, cells: int = 8) -> Path:
    """A sheet over the tiles 1001 and 1002 that is stretched more from frame to frame, with round studs that are rigid
    in `rigid.<UDIM>.png`, and a texture `colour.<UDIM>.png` of 8 bits. Returns the scene's path."""
    folder.mkdir(parents=True, exist_ok=True)
    stage = scenes.stage(folder / "sheet.usda", 1, frames, fps=None, meters=1)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/model").GetPrim())
    square, faces = grid(cells)
    rest = np.concatenate([square, np.add(square, [1.2, 0, 0])])
    uvs = 0.05 + 0.9 * np.concatenate([square, square])[:, :2] + np.repeat([[0, 0], [1, 0]], len(square), 0)
    (x, y, _), none = rest.T, 0 * rest[:, 0]
    moves = np.stack([np.sin(2 * np.pi * x) * y, none, np.cos(3 * y)], -1)
    poses = {frame: rest + 0.06 * frame * moves for frame in range(1, frames + 1)}
    faces = np.concatenate([faces, faces + len(square)])
    scenes.mesh(stage, MESH, rest, uvs, faces=faces, poses=poses, pref=True)
    stage.Save()
    u, v = centres(64)
    studs = (np.hypot((u * 3) % 1 - 0.5, (v * 3) % 1 - 0.5) < 0.3).astype(np.uint8) * 255
    for udim in (1001, 1002):
        image(folder / f"rigid.{udim}.png", studs[..., None])
        image(folder / f"colour.{udim}.png", np.stack([255 * u, 255 * (1 - v), studs], -1).astype(np.uint8))
    return folder / "sheet.usda"


def with_copies(scene: Path, *names: str) -> Usd.Stage:
    """The stage of a scene, which is not saved, with copies of the sheet by these names."""
    stage = Usd.Stage.Open(str(scene))
    for name in names:
        Sdf.CopySpec(stage.GetRootLayer(), MESH, stage.GetRootLayer(), f"/model/{name}")
    return stage


def with_material(folder: Path, make=scenes.materialx_material, frames: int = 3, cells: int = 4) -> Path:
    """The sheet at 60 frames per second, z up, with a material that `make` makes."""
    path = sheet(folder, frames, cells)
    stage = Usd.Stage.Open(str(path))
    stage.SetTimeCodesPerSecond(60)
    stage.SetMetadata("upAxis", "Z")
    scenes.bind(stage.GetPrimAtPath(MESH), make(stage, "/model/material"))
    stage.Save()
    return path


def sheet_arguments(scene: Path, out: Path, *more: object) -> list[object]:
    """A bake of the sheet on the CPU, with as many cells as the images have texels."""
    rigidity = scene.parent / "rigid.<UDIM>.png"
    painted = next(scene.parent.glob("rigid.*.png"), None)
    # In the header of a PNG: the library that reads images takes no names that are no UTF-8.
    size = int.from_bytes(painted.read_bytes()[16:20], "big") if painted else 64
    return ["bake", scene, "--rigidity", rigidity, "--size", size, "--device", "cpu", "--out", out, *more]


def asset_of(shape: Shape, **mesh: object) -> vrtm.Asset:
    """An asset of a mesh of a scene, without the command. `mesh`: arguments of vrtm.Asset."""
    own = {"face_counts": shape.face_counts, "uvs": shape.uvs, "uv_indices": shape.uv_indices}
    return vrtm.Asset(vrtm.Device("cpu"), shape.rest, shape.indices, **own | mesh)


def solved_alone(
    scene: Path,
    frame: float,
    cells: int = 64,
    maps: str | Path = "rigid.<UDIM>.png",
    options: SceneOptions | None = None,
    settings: dict[str, object] | None = None,
    solve: bool = True,
    **mesh: object,
) -> vrtm.Asset:
    """A frame of a scene's only mesh, solved by the library without the command. `cells` of the grid per side; `maps`:
    the rigidity images, from the scene's folder, with <UDIM> in their name; `settings` of the tiles; `solve`: or left
    before its first solve."""
    with Scene(scene, options or SceneOptions()) as opened:
        (shape,) = opened.shapes
        positions = opened.positions(shape, frame)
    made = asset_of(shape, **mesh)
    for tile in made.tiles:
        path = scene.parent / str(maps).replace("<UDIM>", str(tile.udim))
        tile.set_rigidity(read_map(str(path)) if path.exists() else None)
        tile.set_settings(grid_width=cells, grid_height=cells, **settings or {})
    if solve:
        made.solve(positions)
    return made


def written(ended: subprocess.CompletedProcess[str]) -> tuple[int, int]:
    """Files written, and up to date, by the last line."""
    words = ended.stdout.splitlines()[-1].split()
    return int(words[0]), int(words[3])


def opened(scene: Path, options: SceneOptions | None = None, **settings: object) -> Work:
    """A bake of a scene on the CPU before its first solve, as the command opens it."""
    return Work(Settings(str(scene), options or SceneOptions(), device="cpu", **settings), 1)
