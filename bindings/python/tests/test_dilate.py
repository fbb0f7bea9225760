"""`vrtm dilate`: both sides of a seam show the same."""

from pathlib import Path

import numpy as np
import pytest

import scenes
from bake_scenes import files, image, pixels, run
from conftest import centres, grid

# Two squares side by side; the second one lies in the next tile, turned by 90 degrees and half as large.
OBJ = """\
v 0 0 0\nv 1 0 0\nv 2 0 0\nv 0 1 0\nv 1 1 0\nv 2 1 0
vt 0.1 0.1\nvt 0.9 0.1\nvt 0.9 0.9\nvt 0.1 0.9
vt 1.7 0.3\nvt 1.7 0.7\nvt 1.3 0.7\nvt 1.3 0.3
f 1/1 2/2 5/3 4/4\nf 2/5 3/6 6/7 5/8
"""


def content(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Paint at a point of the surface, from 0 to 1."""
    return np.stack([0.2 + 0.3 * x, 0.1 + 0.8 * y, 0.5 + 0.4 * np.sin(3 * x + 2 * y)], axis=-1)


def at_texels(udim: int, size: int) -> tuple[np.ndarray, np.ndarray]:
    """The points of the surface under the texels of a tile."""
    u, v = centres(size)
    if udim == 1001:
        return (u - 0.1) / 0.8, (v - 0.1) / 0.8
    return 1 + (v - 0.3) / 0.4, (0.7 - u) / 0.4


def inside(udim: int, size: int) -> np.ndarray:
    x, y = at_texels(udim, size)
    x = x if udim == 1001 else x - 1
    return (x >= 0) & (x <= 1) & (y >= 0) & (y <= 1)


def painted(folder: Path, size: int) -> Path:
    """The squares, with content in their charts and a colour of its own beside them."""
    path = folder / "squares.obj"
    path.write_text(OBJ)
    for udim in (1001, 1002):
        texels = np.where(inside(udim, size)[..., None], content(*at_texels(udim, size)), [1.0, 0.0, 1.0])
        image(folder / f"skin.{udim}.png", np.rint(65535 * texels).astype(np.uint16))
        image(folder / f"height.{udim}.exr", texels[..., :1].astype(np.float32))
    return path


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    return painted(tmp_path, 128)


def dilate(scene: Path, *more: object, expect: int = 0):
    out = scene.parent / "out"
    return run("dilate", scene, "--texture", scene.parent / "skin.<UDIM>.png", "--out", out, *more, expect=expect)


# 125 texels put the border of the first chart on texels' centres, 121 and 126 close to them on either side.
@pytest.mark.parametrize("size", [128, 125, 121, 126])
def test_what_lies_beyond_a_seam_is_copied(tmp_path: Path, size: int) -> None:
    scene = painted(tmp_path, size)
    said = dilate(scene, "--texture", scene.parent / "height.<UDIM>.exr", "--reach", "0.08")
    assert "4 files written" in said.stdout
    for name, top in (("skin.{}.png", 65535), ("height.{}.exr", 1)):
        for udim in (1001, 1002):
            before = pixels(scene.parent / name.format(udim))
            after = pixels(scene.parent / "out" / name.format(udim))
            assert before.dtype == after.dtype
            x, y = at_texels(udim, size)
            # The strip beyond the seam, less its ends; all else stays as it was.
            beyond = x - 1 if udim == 1001 else 1 - x
            scale = 0.8 if udim == 1001 else 0.4
            strip = (beyond > 1e-4) & (beyond * scale < 0.04) & (y > 0.1) & (y < 0.9)
            far = (beyond < -1e-4) | (beyond * scale > 0.1) | (y < -0.2) | (y > 1.2)
            assert strip.sum() > 150 and far.sum() > 1000
            wanted = content(x, y)[..., : after.shape[2]]
            assert np.abs(after[strip] / top - wanted[strip]).max() < 0.01
            assert np.array_equal(after[far], before[far])


def test_numbers_that_are_none_stay_where_they_are(scene: Path) -> None:
    path = scene.parent / "height.1001.exr"
    texels = pixels(path).copy()
    texels[64, 64] = np.nan
    image(path, texels)
    run("dilate", scene, "--texture", scene.parent / "height.<UDIM>.exr", "--out", scene.parent / "out")
    for udim, bad in ((1001, 1), (1002, 0)):
        assert np.isnan(pixels(scene.parent / "out" / f"height.{udim}.exr")).sum() == bad


MIRRORED = "vt 1.3 0.3\nvt 1.3 0.7\nvt 1.7 0.7\nvt 1.7 0.3"


# Turned by 90 degrees and half as large, as above; and mirrored.
@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("down", [False, True])
def test_normals_beyond_a_seam_are_turned(tmp_path: Path, mirrored: bool, down: bool) -> None:
    size = 256
    path = tmp_path / "squares.obj"
    path.write_text(OBJ.replace("vt 1.7 0.3\nvt 1.7 0.7\nvt 1.3 0.7\nvt 1.3 0.3", MIRRORED) if mirrored else OBJ)
    # One direction all over the surface, as each chart's axes have it. Those of the first one are the surface's.
    x, y, z = 0.36, 0.48, 0.8
    second = (y, x) if mirrored else (-y, x)
    sign = -1 if down else 1
    for udim, (a, b) in ((1001, (x, y)), (1002, second)):
        chart = inside(udim, size) if udim == 1001 or not mirrored else inside(udim, size)[:, ::-1]
        normal = np.where(chart[..., None], [a, b * sign, z], [0.0, 0.0, 1.0])
        image(tmp_path / f"normal.{udim}.png", np.rint(65535 * (normal + 1) / 2).astype(np.uint16))
    more = ("--normal-y", "down") if down else ()
    run("dilate", path, "--normal-map", tmp_path / "normal.<UDIM>.png", "--out", tmp_path / "out", *more)
    for udim, (a, b) in ((1001, (x, y)), (1002, second)):
        after = pixels(tmp_path / "out" / f"normal.{udim}.png") / 65535 * 2 - 1
        u, v = at_texels(udim, size)
        if udim == 1002 and mirrored:
            u = u[:, ::-1]
        beyond = u - 1 if udim == 1001 else 1 - u
        strip = (beyond > 1e-4) & (beyond * (0.8 if udim == 1001 else 0.4) < 0.04) & (v > 0.1) & (v < 0.9)
        assert strip.sum() > 500
        assert np.abs(after[strip] - [a, b * sign, z]).max() < 0.01


def test_a_second_run_finds_all_up_to_date(scene: Path) -> None:
    dilate(scene)
    before = files(scene.parent / "out")
    said = dilate(scene)
    assert "0 files written, 2 up to date" in said.stdout
    assert files(scene.parent / "out") == before
    # Another reach is another content.
    assert "2 files written" in dilate(scene, "--reach", "0.02").stdout


def test_textures_are_not_replaced(scene: Path) -> None:
    before = files(scene.parent)
    assert "which is read" in dilate(scene, "--out", scene.parent, "--overwrite", expect=2).stderr
    (scene.parent / "out").mkdir()
    (scene.parent / "out" / "skin.1001.png").write_bytes(b"mine")
    assert "--overwrite replaces it" in dilate(scene, expect=2).stderr
    (scene.parent / "out" / "skin.1001.png").unlink()
    (scene.parent / "out").rmdir()
    assert files(scene.parent) == before


def test_a_mesh_without_a_texture_is_told(tmp_path: Path) -> None:
    stage = scenes.stage(tmp_path / "two.usda")
    for tile, name in enumerate(("first", "second")):
        square, faces = grid(1)
        scenes.mesh(stage, f"/{name}", square, 0.1 + 0.8 * square[:, :2] + [tile, 0], faces=faces)
    image(tmp_path / "skin.1001.png", np.zeros((32, 32, 3), np.uint8))
    said = dilate(Path(scenes.saved(stage)))
    assert "1 file written" in said.stdout
    assert "/second: left out, with its charts" in said.stderr and "1002" in said.stderr


def test_tiles_of_other_numbers_are_refused(scene: Path) -> None:
    path = scene.parent / "skin.1002.png"
    image(path, (pixels(path) // 257).astype(np.uint8))
    assert f"{path}: other channels or numbers" in dilate(scene, expect=2).stderr
    assert not (scene.parent / "out").exists()


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (("--reach", "0.7"), "reach: 0.7"),
        (("--reach", "-1"), "not a number above 0"),
        (("--texture", "none.<UDIM>.png"), "none.<UDIM>.png: no such file"),
    ],
)
def test_bad_input_is_named(scene: Path, more: tuple[str, ...], message: str) -> None:
    said = dilate(scene, *more, expect=2)
    assert message in said.stderr
    assert not (scene.parent / "out").exists()
