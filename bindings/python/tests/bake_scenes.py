"""Scenes for the tests of the console command: a small one with two tiles, and real meshes where they are at hand."""

from __future__ import annotations

import contextlib
import json
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
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, Vt

import scenes
import vrtm
from vrtm.bake import warped
from vrtm.bake.scene import Scene
from vrtm.bake.scene.images import read_map
from vrtm.cli import main

PACKAGE = Path(__file__).resolve().parents[1]
REPOSITORY = PACKAGE.parents[1]
# Where the package is that these tests are of: among the installed ones, or the sources.
INSTALLED = Path(vrtm.__file__).resolve().parents[1]
# The mesh of `sheet`.
MESH = "/model/sheet"


def vrtm_command(*arguments: object, **environment: str) -> tuple[list[str], dict[str, str]]:
    """The console command as a subprocess has to be called, and its environment."""
    kept = {name: value for name, value in os.environ.items() if name not in ("VRTM_DEVICE", "VRTM_THREADS")}
    path = os.pathsep.join(filter(None, [str(INSTALLED), os.environ.get("PYTHONPATH")]))
    return [sys.executable, "-m", "vrtm.cli", *map(str, arguments)], kept | {"PYTHONPATH": path} | environment


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
    """Writes (height, width, channels) pixels as they are."""
    kind = {"float16": "half", "float32": "float"}.get(str(pixels.dtype), str(pixels.dtype))
    spec = oiio.ImageSpec(pixels.shape[1], pixels.shape[0], pixels.shape[2], kind)
    for name, value in attributes.items():
        spec.attribute(name, value)
    out = oiio.ImageOutput.create(str(path))
    assert out.open(str(path), spec) and out.write_image(pixels) and out.close(), out.geterror()
    return path


def pixels(path: Path) -> np.ndarray:
    """(height, width, channels) as they are stored."""
    config = oiio.ImageSpec()
    config.attribute("oiio:UnassociatedAlpha", 1)
    file = oiio.ImageInput.open(str(path), config)
    assert file is not None, oiio.geterror()
    spec = file.spec()
    return np.asarray(file.read_image(spec.format)).reshape(spec.height, spec.width, spec.nchannels)


def attributes(path: Path) -> dict[str, object]:
    """All attributes of an image."""
    return {a.name: a.value for a in oiio.ImageInput.open(str(path)).spec().extra_attribs}


def sheet(folder: Path, frames: int = 5, cells: int = 8, mesh: str = "sheet") -> Path:
    """A sheet over the tiles 1001 and 1002 that is stretched more from frame to frame, with round studs that are rigid
    in `rigid.<UDIM>.png`, and a texture `colour.<UDIM>.png` of 8 bits. Returns the scene's path."""
    folder.mkdir(parents=True, exist_ok=True)
    scene = folder / "sheet.usda"
    stage = Usd.Stage.CreateNew(str(scene))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    stage.SetStartTimeCode(1)
    stage.SetEndTimeCode(frames)
    root = UsdGeom.Xform.Define(stage, "/model")
    stage.SetDefaultPrim(root.GetPrim())
    prim = UsdGeom.Mesh.Define(stage, f"/model/{mesh}")
    prim.CreateSubdivisionSchemeAttr("none")
    points, uvs, indices = [], [], []
    for tile in range(2):
        first = len(points)
        for j in range(cells + 1):
            for i in range(cells + 1):
                points.append((tile * 1.2 + i / cells, j / cells, 0.0))
                uvs.append((tile + 0.05 + 0.9 * i / cells, 0.05 + 0.9 * j / cells))
        for j in range(cells):
            for i in range(cells):
                at = first + j * (cells + 1) + i
                indices += [at, at + 1, at + cells + 2, at + cells + 1]
    prim.CreateFaceVertexCountsAttr([4] * (len(indices) // 4))
    prim.CreateFaceVertexIndicesAttr(indices)
    rest = np.array(points)
    attribute = prim.CreatePointsAttr([Gf.Vec3f(*map(float, p)) for p in rest])
    for frame in range(1, frames + 1):
        amount = 0.06 * frame
        moved = rest.copy()
        moved[:, 0] += amount * np.sin(2 * np.pi * rest[:, 0]) * rest[:, 1]
        moved[:, 2] += amount * np.cos(3 * rest[:, 1])
        attribute.Set([Gf.Vec3f(*map(float, p)) for p in moved], frame)
    UsdGeom.PrimvarsAPI(prim).CreatePrimvar("Pref", Sdf.ValueTypeNames.Point3fArray, UsdGeom.Tokens.vertex).Set(
        [Gf.Vec3f(*map(float, p)) for p in rest]
    )
    primvar = UsdGeom.PrimvarsAPI(prim).CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.vertex)
    primvar.Set([Gf.Vec2f(*map(float, uv)) for uv in uvs])
    stage.Save()
    at = (np.arange(64) + 0.5) / 64
    x, y = np.meshgrid(at, at)
    studs = (np.hypot((x * 3) % 1 - 0.5, (y * 3) % 1 - 0.5) < 0.3).astype(np.uint8) * 255
    colour = np.stack([255 * x, 255 * y, studs], axis=-1).astype(np.uint8)
    for udim in (1001, 1002):
        image(folder / f"rigid.{udim}.png", studs[..., None])
        image(folder / f"colour.{udim}.png", colour)
    return scene


def with_material(folder: Path, make=scenes.materialx_material) -> Path:
    """The sheet in three frames at 60 per second, z up, with a material that `make` makes."""
    path = sheet(folder, frames=3, cells=4)
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


def solved_alone(scene: Path, frame: int, maps: Path, cells: int) -> vrtm.Asset:
    """A frame of a scene's only mesh, solved by the library without the command. `maps`: the rigidity images, with
    <UDIM> in their name; `cells` of the grid per side."""
    with Scene(scene) as opened:
        (shape,) = opened.shapes
        positions = opened.positions(shape, frame)
    made = vrtm.Asset(
        vrtm.Device("cpu"),
        shape.rest,
        shape.indices,
        face_counts=shape.face_counts,
        uvs=shape.uvs,
        uv_indices=shape.uv_indices,
    )
    for tile in made.tiles:
        path = Path(str(maps).replace("<UDIM>", str(tile.udim)))
        tile.set_rigidity(read_map(str(path)) if path.exists() else None)
        tile.set_settings(tile.settings, grid_width=cells, grid_height=cells)
    made.solve(positions)
    return made


def asset(name: str) -> Path:
    """The folder of a real mesh; skips the test where there is none."""
    folder = Path(os.environ.get("VRTM_ASSETS") or REPOSITORY.parent / "shared" / "assets") / name
    if not folder.is_dir():
        assert not os.environ.get("VRTM_REQUIRE_ASSETS"), f"{folder} is missing"
        pytest.skip(f"skipped: no {folder}")
    return folder


def asset_scene(name: str, folder: Path, repeats: int = 1) -> Path:
    """A real mesh and its frames as a USD file, the frames over and over again, a little further each time."""
    source = asset(name)
    told = json.loads((source / "asset.json").read_text())
    with Scene(source / "rest.obj") as scene:
        (shape,) = scene.shapes
    poses = np.fromfile(source / "frames.f32", "<f4").reshape(told["frames"], -1, 3)
    path = folder / f"{name}.usdc"
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 0.01)
    stage.SetStartTimeCode(1)
    stage.SetEndTimeCode(len(poses) * repeats)
    prim = UsdGeom.Mesh.Define(stage, f"/{name}")
    stage.SetDefaultPrim(prim.GetPrim())
    prim.CreateSubdivisionSchemeAttr("none")
    prim.CreateFaceVertexCountsAttr(shape.face_counts)
    prim.CreateFaceVertexIndicesAttr(shape.indices)
    attribute = prim.CreatePointsAttr()
    rest = shape.rest.astype(np.float32)
    UsdGeom.PrimvarsAPI(prim).CreatePrimvar("Pref", Sdf.ValueTypeNames.Point3fArray, UsdGeom.Tokens.vertex).Set(rest)
    uvs = UsdGeom.PrimvarsAPI(prim).CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.faceVarying)
    uvs.Set(shape.uvs.astype(np.float32))
    uvs.SetIndices(Vt.IntArray.FromNumpy(shape.uv_indices.astype(np.int32)))
    for index in range(len(poses) * repeats):
        share = np.float32(1 - 0.05 * (index // len(poses)))
        attribute.Set(rest + share * (poses[index % len(poses)] - rest), index + 1)
    stage.Save()
    return path
