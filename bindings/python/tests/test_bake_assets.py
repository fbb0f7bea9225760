"""Real meshes through the console command."""

from pathlib import Path

import numpy as np
import pytest

from bake_scenes import files, pixels, real_scene, run, solved_alone, written
from conftest import real_mesh


@pytest.mark.parametrize("name", ["mh_face", "ict_inner"])
def test_real_meshes(name: str, tmp_path: Path) -> None:
    scene, out = real_scene(name, tmp_path), tmp_path / "out"
    maps = real_mesh(name) / "rigidity.<UDIM>.png"
    arguments = ["bake", scene, "--rigidity", maps, "--device", "cpu", "--out", out, "--size", 128, "--frames", "1-2"]
    run(*arguments, "--jobs", 2)
    before = files(out)
    mesh = solved_alone(scene, 2, 128, maps)
    assert len(before) == 2 * len(mesh.tiles)
    for tile in mesh.tiles:
        expected = tile.fetch("redirection", (128, 128), channels=3)
        assert np.array_equal(pixels(out / f"redirect.0002.{tile.udim}.exr"), expected)
    assert written(run(*arguments)) == (0, len(before)) and files(out) == before
