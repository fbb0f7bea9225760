"""`vrtm bake --seams continue`: features keep their shape across seams, and copies of textures show what lies there."""

from pathlib import Path

import numpy as np
import pytest

from bake_scenes import files, image, pixels, run
from conftest import centres, grid

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


@pytest.fixture
def scene(tmp_path: Path) -> list[object]:
    """The arguments of a bake of a sheet with a rigid disc in the middle, over the seam, and a texture with a colour of
    its own beside the charts."""
    for tile in range(2):
        x, y = on_sheet(tile)
        inside = (x >= tile) & (x <= tile + 1) & (y >= 0) & (y <= 1)
        disc = np.hypot(x - 1, y - 0.5) < 0.1
        image(tmp_path / f"rigid.{1001 + tile}.png", np.where(inside & disc, 255, 0).astype(np.uint8)[..., None])
        content = np.stack([0.2 + 0.3 * x, 0.2 + 0.6 * y, 0.3 + 0.2 * np.sin(20 * x)], axis=-1)
        colour = np.where(inside[..., None], content, [1.0, 0.0, 1.0])
        image(tmp_path / f"colour.{1001 + tile}.png", np.rint(65535 * colour).astype(np.uint16))
    rest, pose = write_obj(tmp_path / "rest.obj", False), write_obj(tmp_path / "pose.obj", True)
    maps = ["--rigidity", tmp_path / "rigid.<UDIM>.png", "--texture", tmp_path / "colour.<UDIM>.png"]
    return ["bake", rest, "--poses", pose, *maps]


def test_both_sides_of_a_seam_show_the_same(scene: list[object], tmp_path: Path) -> None:
    run(*scene, "--seams", "continue", "--out", tmp_path / "out")
    left, right = (pixels(next((tmp_path / "out").glob(f"*colour*{1001 + tile}*"))) / 65535 for tile in range(2))
    redirections = [pixels(next((tmp_path / "out").glob(f"*redirect*{1001 + tile}*"))) for tile in range(2)]
    column = round(0.9 * SIZE), round(0.1 * SIZE)
    rows = slice(int(0.15 * SIZE), int(0.85 * SIZE))
    # The texels on either side of the seam. Something moves there, and no colour from beside the charts gets in.
    own = (np.arange(SIZE) + 0.5)[None, :] / SIZE
    moved = SIZE * np.abs(redirections[0][rows, :, 0] - own)[:, column[0] - 2 : column[0]]
    assert moved.max() > 0.3, moved.max()
    before, after = left[rows, column[0] - 1], right[rows, column[1]]
    assert before[:, 1].min() > 0.15 and after[:, 1].min() > 0.15
    # A texel is 0.3 / (0.8 * SIZE) wide in the first channel.
    assert np.abs(after - before)[:, :2].max() < 0.012, np.abs(after - before).max(axis=0)


def test_files_depend_on_the_maps_of_other_tiles(scene: list[object], tmp_path: Path) -> None:
    arguments = [*scene, "--seams", "continue", "--out", tmp_path / "out"]
    run(*arguments)
    before = files(tmp_path / "out")
    image(tmp_path / "rigid.1002.png", np.zeros((SIZE, SIZE, 1), np.uint8))
    run(*arguments)
    after = files(tmp_path / "out")
    first = [name for name in before if "redirect" in name and "1001" in name]
    assert first and all(after[name] != before[name] for name in first)


def test_normals_at_seams(scene: list[object], tmp_path: Path) -> None:
    normal = [0.36, 0.48, 0.8]
    for tile in range(2):
        x, y = on_sheet(tile)
        inside = (x >= tile) & (x <= tile + 1) & (y >= 0) & (y <= 1)
        texels = np.where(inside[..., None], normal, [0.0, 0.0, 1.0])
        image(tmp_path / f"bumps.{1001 + tile}.png", np.rint(65535 * (texels + 1) / 2).astype(np.uint16))
    run(*scene, "--seams", "continue", "--normal-map", tmp_path / "bumps.<UDIM>.png", "--out", tmp_path / "out")
    copies = [pixels(next((tmp_path / "out").glob(f"*bumps*{1001 + tile}*"))) / 65535 * 2 - 1 for tile in range(2)]
    column, rows = round(0.9 * SIZE), slice(int(0.15 * SIZE), int(0.85 * SIZE))
    at_seam = copies[0][rows, column - 1], copies[1][rows, SIZE - column]
    # The warp turns them a little, on both sides alike; nothing from beside the charts gets in.
    assert np.abs(at_seam[0] - at_seam[1]).max() < 0.08
    assert np.abs(at_seam[0][:, 2] - normal[2]).max() < 0.01 and np.abs(at_seam[0] - normal).max() < 0.1


def test_textures_slide_along_open_borders(scene: list[object], tmp_path: Path) -> None:
    x, y = on_sheet(0)
    disc = (x >= 0) & (y >= 0) & (np.hypot(x - 0.5, y) < 0.15)
    image(tmp_path / "rigid.1001.png", np.where(disc, 255, 0).astype(np.uint8)[..., None])
    deltas = []
    for open_borders in ("fixed", "slide"):
        out = tmp_path / open_borders
        run(*scene, "--open-borders", open_borders, "--form", "delta", "--out", out)
        delta = SIZE * pixels(next(out.glob("*redirect*1001*")))[round(0.9 * SIZE) - 1]
        deltas.append(np.abs(delta).max(axis=0))
    # In texels, of the row of texels at the lower border.
    assert deltas[0].max() < 0.5, deltas
    assert deltas[1][0] > 1 and deltas[1][1] < 0.2, deltas


def test_features_at_seams_are_kept(scene: list[object], tmp_path: Path) -> None:
    x, y = on_sheet(0)
    rigid = [np.hypot(x - centre, y - 0.5) < 0.1 for centre in (0.4, 1.0)]
    image(tmp_path / "rigid.1001.png", np.where(rigid[0] | rigid[1], 255, 0).astype(np.uint8)[..., None])
    deltas = {}
    for seams in ("shut", "keep"):
        run(*scene, "--seams", seams, "--form", "delta", "--out", tmp_path / seams)
        delta = pixels(next((tmp_path / seams).glob("*redirect*1001*")))
        # Beside the rim of the feature at the seam.
        at_seam = (np.hypot(x - 1, y - 0.5) < 0.09) & (x < 1)
        deltas[seams] = [SIZE * np.abs(delta[where]).max() for where in (rigid[0], at_seam)]
    assert deltas["shut"][1] > 0.3 and deltas["keep"][1] == 0, deltas
    assert deltas["keep"][0] > 0.3, deltas
