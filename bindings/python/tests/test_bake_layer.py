"""The layer that a bake writes, and its files of corner UVs."""

from pathlib import Path

import numpy as np
import pytest
from pxr import Usd, UsdGeom

from bake_scenes import files, run, sheet_arguments, solved_alone, with_material, written
from scenes import preview_material
from usd_validators import check_layer


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return with_material(tmp_path_factory.mktemp("sheet"), preview_material, 5, 8)


@pytest.mark.parametrize("mode", ["texture", "primvar"])
def test_a_layer_goes_over_the_shot(scene: Path, tmp_path: Path, mode: str) -> None:
    layer = tmp_path / "shot" / "redirect.usda"
    layer.parent.mkdir()
    options = ("--form", "udim", "--layer", layer, "--layer-mode", mode, "--seams", "shut")
    run(*sheet_arguments(scene, tmp_path / "maps", *options, "--texture", scene.parent / "colour.<UDIM>.png"))
    assert check_layer(layer, scene) == []
    over = Usd.Stage.Open(str(layer))
    over.GetRootLayer().subLayerPaths = [str(scene)]
    primvar = UsdGeom.PrimvarsAPI(over.GetPrimAtPath("/model/sheet")).GetPrimvar("st_redirected")
    assert bool(primvar) == (mode != "texture")
    if mode == "texture":
        assert "colour.0003.<UDIM>.png" in layer.read_text()
    for frame in (1, 4) if primvar else ():
        assert np.array_equal(np.array(primvar.Get(frame)), solved_alone(scene, frame).corner_uvs())


def test_corner_uvs_are_up_to_date_or_made_anew(scene: Path, tmp_path: Path) -> None:
    layer = tmp_path / "redirect.usda"
    options = ("--form", "udim", "--layer", layer, "--layer-mode", "primvar", "--frames", "1-2")
    maps = tmp_path / "maps"
    assert written(run(*sheet_arguments(scene, maps, *options))) == (6, 0)
    before = files(tmp_path)
    assert written(run(*sheet_arguments(scene, maps, *options, "--jobs", 2))) == (0, 6)
    corners = maps / "corners.0002.usdc"
    whole = corners.read_bytes()
    other = (maps / "corners.0001.usdc").read_bytes()
    for damage in (b"", whole[:200], whole[:-30], other, b"PXR-USDC" + bytes(len(whole))):
        corners.write_bytes(damage)
        assert written(run(*sheet_arguments(scene, maps, *options))) == (1, 5)
        assert files(tmp_path) == before
    # Tasks of a farm: frames by themselves, then the layer alone.
    parts = tmp_path / "parts" / "maps"
    parts.mkdir(parents=True)
    rest = ("--form", "udim", "--layer", parts.parent / "redirect.usda", "--layer-mode", "primvar")
    for frame in (2, 1):
        run(*sheet_arguments(scene, parts, *rest, "--frames", frame))
    run(*sheet_arguments(scene, parts, *rest, "--frames", "1-2", "--only-layer"))
    found = files(parts.parent)
    assert found == {name: content for name, content in before.items() if not name.startswith("parts")}


def test_wrong_layers(scene: Path, tmp_path: Path) -> None:
    obj = tmp_path / "a.obj"
    obj.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n")
    out = tmp_path / "out"
    for arguments, words in [
        (sheet_arguments(scene, out, "--form", "tile", "--layer", tmp_path / "l.usda"), "udim"),
        (sheet_arguments(scene, out, "--form", "udim", "--layer", tmp_path / "l.txt"), ".usda"),
        (sheet_arguments(scene, out, "--layer", "l.usda", "--layer-mode", "primvar", "--tiles", 1001), "--tiles"),
        (sheet_arguments(scene, out, "--only-layer"), "--layer"),
        (["bake", obj, *sheet_arguments(scene, out, "--layer", tmp_path / "l.usda")[2:]], "USD"),
    ]:
        ended = run(*arguments, expect=2)
        assert words in ended.stderr.splitlines()[-1], ended.stderr
        assert not out.exists() and not (tmp_path / "l.usda").exists()
