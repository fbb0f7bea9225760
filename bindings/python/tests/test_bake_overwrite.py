"""Files that a bake must not replace: those that it reads, and those that vrtm has not written."""

import functools
import json
import os
import shutil
from pathlib import Path

import numpy as np
import pytest
from pxr import Sdf, Usd

import scenes
from bake_scenes import files, image, run, sheet_arguments, with_material
from scenes import preview_material
from vrtm.bake import overwrite
from vrtm.bake.mark import mark


@pytest.fixture
def shot(tmp_path: Path) -> Path:
    """A shot that references an asset, whose material names the texture; all in one folder. Returns the shot."""
    folder = tmp_path / "shot"
    with_material(folder, functools.partial(preview_material, texture="./colour.<UDIM>.png"), 2)
    shot = scenes.stage(folder / "shot.usda", 1, 2, fps=60, meters=1)
    prim = shot.OverridePrim("/model")
    prim.GetReferences().AddReference("./sheet.usda")
    shot.SetDefaultPrim(prim)
    shot.Save()
    return folder / "shot.usda"


def refused(arguments: list[object], *words: object) -> None:
    """Checks that a bake ends with exit code 2 before it has changed anything, and with one line that has the words."""
    folder = Path(str(arguments[1])).parent
    before = files(folder)
    ended = run(*arguments, expect=2)
    assert len(ended.stderr.splitlines()) == 1 and ended.stdout == "", ended.stderr
    for word in words:
        assert str(word) in ended.stderr, f"'{word}' in: {ended.stderr}"
    assert files(folder) == before


def test_inputs_are_never_replaced(shot: Path) -> None:
    folder = shot.parent
    out = folder / "out"
    textures = ("--texture", folder / "colour.<UDIM>.png", "--frames", 1, "--name", "<kind>.<UDIM>.exr")
    for more, words in [
        (("--layer", shot), ("--layer", "shot.usda", "the scene")),
        (("--layer", folder / "sheet.usda"), ("--layer", "sheet.usda", "a file of the scene")),
        (("--report", shot), ("--report", "shot.usda", "the scene")),
        (("--report", folder / "rigid.1002.png"), ("--report", "rigid.1002.png", "--rigidity")),
        (
            ("--report", folder / "colour.1001.png"),
            ("--report", "colour.1001.png", "a file of the scene, which is read"),
        ),
        (("--mask", folder / "colour.<UDIM>.png", "--report", folder / "colour.1001.png"), ("--report", "--mask")),
        (("--rest", folder / "sheet.usda", "--report", folder / "sheet.usda"), ("--report", "sheet.usda")),
    ]:
        # Not even with the option that replaces files of other programs.
        for overwriting in ((), ("--overwrite",)):
            refused(sheet_arguments(shot, out, *more, *overwriting), *words)
    # The painted texture, by its own name, through links, and in capital letters.
    refused(sheet_arguments(shot, folder, *textures), "colour.1001.png", "--texture")
    links, hard, capitals = folder / "links", folder / "hard", folder / "capitals"
    os.symlink(folder, links)
    refused(sheet_arguments(shot, links, *textures, "--overwrite"), "colour.1001.png", "--texture")
    links.unlink()
    hard.mkdir()
    os.link(folder / "colour.1002.png", hard / "colour.1002.png")
    refused(sheet_arguments(shot, hard, *textures, "--overwrite"), "hard/colour.1002.png", "--texture")
    (hard / "colour.1002.png").unlink()
    os.symlink(folder / "rigid.1001.png", hard / "redirect.1001.exr")
    refused(sheet_arguments(shot, hard, *textures, "--overwrite"), "hard/redirect.1001.exr", "--rigidity")
    capitals.mkdir()
    for udim in (1001, 1002):
        shutil.copy(folder / f"colour.{udim}.png", capitals / f"COLOUR.{udim}.PNG")
    named = ("--texture", capitals / "COLOUR.<UDIM>.PNG", *textures[2:-1], "<kind>.<UDIM>.exr")
    refused(sheet_arguments(shot, capitals, *named), "COLOUR.1001.png", "--texture")
    # Maps that are read and maps that are written by one name.
    for udim in (1001, 1002):
        image(folder / f"redirect.{udim}.exr", np.zeros((8, 8, 3), np.float32))
    arguments = ["bake", shot, "--rigidity", folder / "redirect.<UDIM>.exr", "--out", folder, *textures[2:]]
    refused([*arguments, "--overwrite"], "redirect.1001.exr", "--rigidity")


def test_an_obj_and_its_poses_are_never_replaced(tmp_path: Path) -> None:
    text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0.1 0.1\nvt 0.9 0.1\nvt 0.1 0.9\nf 1/1 2/2 3/3\n"
    for name in ("rest", "pose.0001", "pose.0002", "other"):
        (tmp_path / f"{name}.obj").write_text(text)
    image(tmp_path / "rigid.png", np.full((8, 8, 1), 255, np.uint8))
    arguments = ["bake", tmp_path / "rest.obj", "--rigidity", tmp_path / "rigid.png", "--out", tmp_path / "out"]
    arguments += ["--poses", tmp_path / "pose.####.obj", "--rest", tmp_path / "other.obj", "--frames", 1]
    for name in ("rest.obj", "pose.0001.obj", "pose.0002.obj", "other.obj", "rigid.png"):
        refused([*arguments, "--overwrite", "--report", tmp_path / name], "--report", name)


def test_files_of_others_are_replaced_on_request_only(shot: Path) -> None:
    folder = shot.parent
    out = folder / "out"
    out.mkdir()
    layer, report = folder / "vrtm.usda", folder / "report.json"
    wanted = sheet_arguments(shot, out, "--layer", layer, "--layer-mode", "primvar", "--report", report)
    wanted += ["--texture", folder / "colour.<UDIM>.png"]
    run(*wanted)
    before = files(folder)
    assert len(before) == 6 + 8 + 2 + 3
    # All of its own are replaced without a question.
    run(*wanted, "--quality", "draft")
    (out / "redirect.0002.1001.exr").write_bytes(b"")
    run(*wanted)
    written = {name for name in before if name not in ("report.json",)}
    assert all((folder / name).read_bytes() == before[name] for name in written)
    other = Sdf.Layer.CreateAnonymous(".usdc")
    other.comment = "an artist's"
    other.Export(str(folder / "artist.usdc"))
    for name, content in [
        ("out/redirect.0002.1001.exr", image(folder / "x.exr", np.zeros((8, 8, 3), np.float32)).read_bytes()),
        ("out/colour.0001.1002.png", before["colour.1002.png"]),
        ("out/corners.0002.usdc", (folder / "artist.usdc").read_bytes()),
        ("vrtm.usda", before["shot.usda"]),
        ("vrtm.manifest.usda", b"#usda 1.0\n"),
        ("report.json", b'{"program": {"name": "another"}}'),
        ("report.json", b"notes on vrtm bake and vrtm:inputs"),
    ]:
        (folder / name).write_bytes(content)
        refused(wanted, name, "--overwrite")
        run(*wanted, "--overwrite")
        assert (folder / name).read_bytes() != content
    assert all((folder / name).read_bytes() == before[name] for name in written)
    # A folder or a device cannot be replaced by any option.
    report.unlink()
    report.mkdir()
    refused([*wanted, "--overwrite"], "report.json", "no file")
    refused([*wanted[:-4], "--overwrite", "--report", "/dev/null"], "/dev/null", "no file")


def test_the_layer_of_an_earlier_bake_may_lie_below_the_shot(shot: Path) -> None:
    folder = shot.parent
    layer = folder / "vrtm.usda"
    wanted = sheet_arguments(shot, folder / "out", "--layer", layer, "--texture", folder / "colour.<UDIM>.png")
    run(*wanted)
    stage = Usd.Stage.Open(str(shot))
    stage.GetRootLayer().subLayerPaths = ["./vrtm.usda"]
    stage.Save()
    before = files(folder)
    run(*wanted)
    assert files(folder) == before
    # By another way to the same file, too.
    os.symlink(folder, folder.parent / "way")
    text = layer.read_text()
    other = sheet_arguments(shot, folder / "out", "--layer", folder.parent / "way" / "vrtm.usda")
    run(*other, "--texture", folder / "colour.<UDIM>.png")
    again = layer.read_text()
    assert again.count("specializes") == text.count("specializes") and "redirected_sheet" not in again
    # What was flattened has the mark, and all that the shot is made of: it is an input.
    stage = Usd.Stage.Open(str(layer))
    stage.GetRootLayer().subLayerPaths = ["./sheet.usda"]
    flat = folder / "flat.usda"
    stage.Flatten().Export(str(flat))
    assert "vrtm_kind" in flat.read_text()
    above = Sdf.Layer.CreateNew(str(folder / "above.usda"))
    above.subLayerPaths = ["./flat.usda"]
    above.Save()
    refused(["bake", folder / "above.usda", *wanted[2:], "--layer", flat, "--overwrite"], "flat.usda", "of the scene")
    run(*wanted, "--overwrite")
    # But one that is the scene itself is read.
    above = Sdf.Layer.FindOrOpen(str(layer))
    above.subLayerPaths = ["./sheet.usda"]
    above.Save()
    refused(["bake", layer, *wanted[2:]], "--layer", "the scene")


def test_one_file_is_not_written_twice_nor_what_is_no_file(shot: Path) -> None:
    folder = shot.parent
    out = folder / "out"
    for name in ("redirect.0001.1001.exr", "REDIRECT.0001.1001.EXR"):
        refused(sheet_arguments(shot, out, "--report", out / name), "--report", "also the file of --out")
    both = ("--layer", folder / "new.usda", "--report", folder / "new.usda")
    refused(sheet_arguments(shot, out, *both), "--report", "also the file of --layer")
    (folder / "plain").write_text("a file")
    for option, name in (("--report", ""), ("--report", f"{folder}/out/"), ("--report", folder / "plain" / "r.json")):
        refused(sheet_arguments(shot, folder / "out", option, name), option)
    refused(sheet_arguments(shot, folder / "plain"), "--out", "no folder")
    refused(sheet_arguments(shot, os.fsdecode(b"o\xff")), "no UTF-8")


def test_folders_are_made_for_maps_alone(shot: Path) -> None:
    missing = shot.parent / "no" / "such"
    for option, name in (("--report", "r.json"), ("--layer", "l.usda")):
        refused(sheet_arguments(shot, shot.parent / "out", option, missing / name), option, "no folder", missing)
    out = shot.parent / "new" / "out"
    run(*sheet_arguments(shot, out, "--frames", 1, "--report", out / "notes" / "r.json"))
    assert json.loads((out / "notes" / "r.json").read_text())["exit_code"] == 0


def test_marks(tmp_path: Path) -> None:
    def ours(content: bytes) -> bool:
        path = tmp_path / "file.usda"
        path.write_bytes(content)
        return overwrite.is_ours(str(path))

    painted = image(tmp_path / "painted.png", np.full((2, 2, 3), 7, np.uint8)).read_bytes()
    told = image(tmp_path / "told.tif", np.full((300, 300, 3), 7, np.uint8), ImageDescription='{"vrtm:inputs": "x"}')
    assert ours(b"") and ours(told.read_bytes()) and not ours(painted)
    # A text that speaks of the marks has none.
    assert not ours(b"vrtm:inputs\0 vrtm:kind\0") and not ours(b'{"a": "vrtm bake", "program": {"name": "vrtm bake"}}')
    assert ours(b'{\n "program": {\n  "name": "vrtm bake",\n  "version": "9"\n }}')
    # A layer that is cut short is nobody's, one that is whole and not marked is; a mark holds for a content.
    assert ours(b"PXR-USDC" + bytes(100)) and not ours(b"#usda 1.0\n") and not ours(b"#usda 1.0\ndef {")
    layer = Sdf.Layer.CreateAnonymous(".usda")
    Sdf.CreatePrimInLayer(layer, "/model")
    mark(layer, "layer")
    text = layer.ExportToString()
    assert ours(text.encode()) and not ours(text.replace("model", "edited").encode())
    assert not ours(b'#usda 1.0\n(\n customLayerData = {\n  string vrtm_kind = "layer"\n }\n)\n')
    # Much else may stand in front of an image's mark.
    long = {"aaa": "x" * 200_000, "vrtm:inputs": "y", "zzz": "x" * 200_000}
    for name, dtype in (("long.exr", np.float32), ("long.png", np.uint8)):
        assert ours(image(tmp_path / name, np.full((2, 2, 3), 7, dtype), **long).read_bytes())
    link = tmp_path / "link"
    link.symlink_to(tmp_path / "nowhere")
    assert overwrite.is_ours(str(link))
