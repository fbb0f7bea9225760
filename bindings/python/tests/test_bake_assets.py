"""Real meshes through the console command, and the example's bake program beside it."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import numpy as np
import pytest

from bake_scenes import REPOSITORY, asset, asset_scene, files, image, pixels, run, solved_alone
from test_bake_command import written


@pytest.mark.parametrize("name", ["mh_face", "ict_inner"])
def test_real_meshes(name: str, tmp_path: Path) -> None:
    source = asset(name)
    scene = asset_scene(name, tmp_path)
    out = tmp_path / "out"
    arguments = ["bake", scene, "--rigidity", source / "rigidity.<UDIM>.png", "--device", "cpu", "--out", out]
    arguments += ["--size", 128, "--frames", "1-2"]
    run(*arguments, "--jobs", 2)
    before = files(out)
    mesh = solved_alone(scene, 2, source / "rigidity.<UDIM>.png", 128)
    assert len(before) == 2 * len(mesh.tiles)
    for tile in mesh.tiles:
        expected = tile.fetch("redirection", (128, 128), channels=3)
        assert np.array_equal(pixels(out / f"redirect.0002.{tile.udim}.exr"), expected)
    assert written(run(*arguments)) == (0, len(before))
    (out / sorted(before)[1]).write_bytes(before[sorted(before)[1]][:-1000])
    assert written(run(*arguments)) == (1, len(before) - 1)
    assert files(out) == before


def example() -> str:
    """The example's program, if it is built."""
    named = os.environ.get("VRTM_BAKE")
    target = Path(os.environ.get("CARGO_TARGET_DIR") or REPOSITORY / "target")
    built = [named] if named else [str(p) for p in target.glob("*/examples/bake") if os.access(p, os.X_OK)]
    if not built:
        pytest.skip("skipped: the example bake is not built, and VRTM_BAKE does not name it")
    return built[0]


def test_the_example_writes_the_same_maps(tmp_path: Path) -> None:
    program = example()
    count = 8
    # Numbers that text keeps exactly.
    grid = [(i, j) for j in range(count + 1) for i in range(count + 1)]
    uvs = "".join(f"vt {1 / 16 + i * 7 / 64} {1 / 16 + j * 7 / 64}\n" for i, j in grid)
    faces = ""
    for j in range(count):
        for i in range(count):
            at = j * (count + 1) + i + 1
            faces += "f " + " ".join(f"{v}/{v}" for v in (at, at + 1, at + count + 2, at + count + 1)) + "\n"
    poses = []
    for number, stretch in enumerate((0.0, 0.25, 0.5)):
        points = "".join(f"v {(i + stretch * (i % 4)) / 8} {j / 8} {stretch * (j % 3) / 4}\n" for i, j in grid)
        path = tmp_path / ("rest.obj" if number == 0 else f"pose.{number:04d}.obj")
        path.write_text(f"o sheet\n{points}{uvs}{faces}")
        poses.append(path)
    x, y = np.meshgrid(np.arange(64), np.arange(64))
    studs = (((x // 8) % 2 == 1) & ((y // 8) % 2 == 1)).astype(np.uint8) * 255
    pattern = image(tmp_path / "r.1001.png", studs[..., None]).with_name("r.<UDIM>.png")
    common = ["--rigidity", str(pattern), "--device", "cpu", "--map-size", "96"]
    theirs = tmp_path / "theirs"
    ended = subprocess.run(
        [program, "--rest", poses[0], "--pose", *poses[1:], *common, "--no-sheet", "--out", theirs],
        capture_output=True,
        text=True,
    )
    assert ended.returncode == 0, ended.stderr
    ours = tmp_path / "ours"
    run("bake", poses[0], "--poses", tmp_path / "pose.####.obj", *common, "--warp", "--out", ours)
    names = sorted(name for name in files(theirs) if name.endswith(".exr"))
    assert names == sorted(files(ours)) and len(names) == 4
    for name in names:
        assert np.array_equal(pixels(ours / name), pixels(theirs / name)), name
    centres = (np.arange(96) + 0.5) / 96
    assert np.abs(pixels(ours / "redirect.0002.1001.exr")[..., 0] - centres).max() > 0.5 / 96
