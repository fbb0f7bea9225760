"""Bakes on a full disk leave whole files or none, and an exit code that tells."""

import contextlib
import io
import json
import os
import resource
from pathlib import Path

import pytest

from bake_scenes import files, image, pixels, run, sheet_arguments, with_material
from scenes import preview_material
from vrtm.bake import staging
from vrtm.cli import main


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = with_material(tmp_path_factory.mktemp("sheet"), preview_material, 1)
    for udim in (1001, 1002):
        # A copy of an image of each format.
        image(path.parent / f"painted.{udim}.tif", pixels(path.parent / f"colour.{udim}.png"))
    return path


def all_kinds(scene: Path, folder: Path) -> list[object]:
    """A bake that writes each kind of file."""
    textures = [scene.parent / name for name in ("colour.<UDIM>.png", "painted.<UDIM>.tif")]
    more = ("--texture", *textures, "--layer", folder / "over.usda", "--layer-mode", "primvar")
    return sheet_arguments(scene, folder / "out", *more, "--report", folder / "report.json")


def limited(arguments: list[object], largest: int) -> tuple[int, str]:
    """Runs the command where no file can be larger than so many bytes: writes beyond that fail, as on a full disk. The
    exit code, and what it says of that."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()) as told:
        resource.setrlimit(resource.RLIMIT_FSIZE, (largest, hard))
        try:
            code = main([str(argument) for argument in arguments])
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    return code, told.getvalue()


def test_files_are_whole_or_not_there(scene: Path, tmp_path: Path) -> None:
    whole = tmp_path / "whole"
    whole.mkdir()
    run(*all_kinds(scene, whole))
    expected = files(whole)
    sizes = {name: len(content) for name, content in expected.items()}
    assert {os.path.splitext(name)[1] for name in sizes} == {".exr", ".png", ".tif", ".usdc", ".usda", ".json"}
    # As much as each kind of file takes, and a few bytes less: the last flush is what fails then.
    kinds = {os.path.splitext(name)[1]: size for name, size in sizes.items()}
    for largest in sorted({size - less for size in kinds.values() for less in (1, 200)} | {min(sizes.values()) // 2}):
        folder = tmp_path / str(largest)
        folder.mkdir()
        code, told = limited(all_kinds(scene, folder), largest)
        found = files(folder)
        fits = all(size <= largest for size in sizes.values())
        assert code == (0 if fits else 2), f"{largest}: {code} {told}"
        # One line names the file.
        assert fits or any(name in told.splitlines()[-1] for name in sizes), told
        assert "Traceback" not in told
        for name, content in found.items():
            # Times stand in the report.
            assert name == "report.json" or content == expected[name], f"{name} at {largest} bytes"
        if "report.json" in found:
            assert json.loads(found["report.json"])["exit_code"] == code


def test_a_damaged_file_is_not_left_on_a_full_disk(scene: Path, tmp_path: Path) -> None:
    run(*all_kinds(scene, tmp_path))
    expected = files(tmp_path)
    for name in ("out/redirect.0001.1001.exr", "out/colour.0001.1002.png", "out/corners.0001.usdc"):
        path = tmp_path / name
        for damage in (expected[name][: len(expected[name]) // 2], expected[name][:-3]):
            path.write_bytes(damage)
            code, told = limited(all_kinds(scene, tmp_path), 100)
            assert code == 2 and name in told, told
            # The report, too, is too large; but it is whole, and of an earlier run.
            left = files(tmp_path)
            assert name not in left and all(left[other] == expected[other] for other in left if other != "report.json")
            run(*all_kinds(scene, tmp_path))
            assert path.read_bytes() == expected[name]
    # One that is whole, and only out of date, stays until another is there.
    name = "out/redirect.0001.1001.exr"
    code, _ = limited([*all_kinds(scene, tmp_path), "--quality", "draft"], 1000)
    assert code == 2 and files(tmp_path)[name] == expected[name]


def test_files_reach_the_disk_before_they_get_their_names(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    done = []
    real_sync, real_replace = os.fsync, os.replace

    def sync(number: int) -> None:
        done.append(os.path.realpath(f"/proc/self/fd/{number}"))
        real_sync(number)

    def replace(source: str, target: str, **folders: int) -> None:
        done.append("renamed")
        real_replace(source, target, **folders)

    monkeypatch.setattr(os, "fsync", sync)
    monkeypatch.setattr(os, "replace", replace)
    staging.write_bytes(str(tmp_path / "a"), b"content")
    assert len(done) == 3 and ".a." in done[0] and done[1:] == ["renamed", str(tmp_path)]

    def fail(_number: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises(OSError, match="No space left"):
        staging.write_bytes(str(tmp_path / "a"), b"another")
    assert files(tmp_path) == {"a": b"content"}
