"""The console command from end to end: what it writes, what it leaves alone, and how it fails."""

import json
import os
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import vrtm
from bake_scenes import (
    attributes,
    files,
    image,
    pixels,
    run,
    sheet,
    sheet_arguments,
    solved_alone,
    vrtm_command,
    written,
)


@pytest.fixture(scope="module")
def solved(scene: Path) -> vrtm.Asset:
    """The sheet's third frame, solved without the command."""
    return solved_alone(scene, 3)


def test_the_files_hold_what_the_library_hands_out(scene: Path, solved: vrtm.Asset, tmp_path: Path) -> None:
    extra = ("--warp", "--jacobian", "--filter-scale", "--map-size", 48)
    run(*sheet_arguments(scene, tmp_path / "f32", "--frames", 3, *extra))
    run(*sheet_arguments(scene, tmp_path / "f16", "--frames", 3, "--half", "--form", "delta", "--alpha"))
    run(*sheet_arguments(scene, tmp_path / "udim", "--frames", 3, "--form", "udim"))
    assert sorted(files(tmp_path / "f32")) == [
        f"{kind}.0003.{udim}.exr" for kind in ("filter", "jacobian", "redirect", "warp") for udim in (1001, 1002)
    ]
    for tile in solved.tiles:
        end = f"0003.{tile.udim}.exr"
        size = (48, 48)
        redirect = tile.fetch("redirection", size, channels=3)
        assert np.abs(redirect[..., :2] - tile.fetch("redirection_delta", size) - redirect[..., :2]).max() > 0.005
        found = pixels(tmp_path / "f32" / f"redirect.{end}")
        assert found.dtype == np.float32 and np.array_equal(found, redirect)
        assert np.array_equal(pixels(tmp_path / "f32" / f"warp.{end}"), tile.fetch("warp", (65, 65), channels=3))
        assert np.array_equal(pixels(tmp_path / "f32" / f"jacobian.{end}"), tile.fetch("jacobian", size))
        scale = pixels(tmp_path / "f32" / f"filter.{end}")
        assert np.array_equal(scale, np.repeat(tile.fetch("filter_scale", size), 3, axis=-1))
        delta = tile.fetch("redirection_delta", (64, 64), dtype=np.float16, channels=4)
        found = pixels(tmp_path / "f16" / f"redirect.{end}")
        assert found.dtype == np.float16 and np.array_equal(found, delta)
        among = tile.fetch("redirection_udim", (64, 64), channels=3)
        assert np.array_equal(pixels(tmp_path / "udim" / f"redirect.{end}"), among)


def test_a_file_tells_what_it_holds(scene: Path, tmp_path: Path) -> None:
    run(*sheet_arguments(scene, tmp_path, "--frames", 2, "--tiles", 1002))
    assert list(files(tmp_path)) == ["redirect.0002.1002.exr"]
    found = attributes(tmp_path / "redirect.0002.1002.exr")
    expected = {
        "vrtm:kind": "redirect",
        "vrtm:form": "tile",
        "vrtm:mesh": "sheet",
        "vrtm:udim": 1002,
        "vrtm:frame": 2,
        "vrtm:version": vrtm.version(),
        "colorInteropID": "data",
        "oiio:ColorSpace": "data",
        "wrapmodes": "clamp",
        "compression": "zip",
        "Software": f"vrtm {vrtm.version()}",
    }
    assert {name: found.get(name) for name in expected} == expected
    assert not {"DateTime", "capDate", "HostComputer"} & set(found)


def test_bytes_do_not_depend_on_how_the_work_is_divided(scene: Path, tmp_path: Path) -> None:
    texture = ("--texture", scene.parent / "colour.<UDIM>.png", "--frames", "1-2")
    run(*sheet_arguments(scene, tmp_path / "one", "--jobs", 1, "--threads", 1, *texture))
    run(*sheet_arguments(scene, tmp_path / "two", "--jobs", 2, "--threads", 2, *texture))
    for tile in (1001, 1002):
        for frame in (2, 1):
            run(*sheet_arguments(scene, tmp_path / "parts", *texture[:2], "--tiles", tile, "--frames", frame))
    one = files(tmp_path / "one")
    assert len(one) == 8 and one == files(tmp_path / "two") == files(tmp_path / "parts")


def test_what_is_up_to_date_is_left_alone(scene: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    moved = tmp_path / "moved"
    shutil.copytree(scene.parent, moved)
    assert written(run(*sheet_arguments(scene, out))) == (10, 0)
    before = files(out)
    times = {p.name: p.stat().st_mtime_ns for p in out.iterdir()}
    assert written(run(*sheet_arguments(scene, out))) == (0, 10)
    # Paths, threads and the course of the work do not count.
    assert written(run(*sheet_arguments(moved / scene.name, out, "--threads", 1, "--jobs", 2))) == (0, 10)
    assert times == {p.name: p.stat().st_mtime_ns for p in out.iterdir()}
    for change in (
        ("--quality", "draft"),
        ("--half",),
        ("--scale", "follow"),
        ("--map-size", 32),
        ("--size", 32),
        ("--mask", scene.parent / "rigid.<UDIM>.png"),
        ("--form", "udim"),
        ("--alpha",),
        ("--weld", "position"),
        ("--rest", "first"),
        ("--measure",),
    ):
        assert written(run(*sheet_arguments(scene, out, *change, "--frames", 1))) == (2, 0), change
        for path in out.glob("redirect.0001.*"):
            path.unlink()
        run(*sheet_arguments(scene, out, "--frames", 1))
    assert files(out) == before
    # One tile's map.
    (moved / "rigid.1002.png").write_bytes((scene.parent / "colour.1002.png").read_bytes())
    assert written(run(*sheet_arguments(moved / scene.name, out))) == (5, 5)


def test_damaged_and_partial_files_are_made_anew(scene: Path, tmp_path: Path) -> None:
    run(*sheet_arguments(scene, tmp_path, "--frames", 1, "--warp"))
    before = files(tmp_path)
    assert len(before) == 4
    for name, content in before.items():
        path = tmp_path / name
        half = len(content) // 2
        flipped = bytes(b ^ 0x55 if index == half else b for index, b in enumerate(content))
        early = bytes(b ^ 0x01 if index == 40 else b for index, b in enumerate(content))
        for damage in (b"", content[:20], content[:half], content[:-1], flipped, early):
            path.write_bytes(damage)
            ended = run(*sheet_arguments(scene, tmp_path, "--frames", 1, "--warp"))
            assert written(ended) == (1, 3), (name, len(damage))
            assert files(tmp_path) == before
    # A file that somebody has painted on, and kept what it tells of itself: one texel differs.
    path = tmp_path / "redirect.0001.1001.exr"
    values = pixels(path)
    values[3, 4, 0] += 1e-3
    told = {name: value for name, value in attributes(path).items() if name.startswith("vrtm:")}
    image(path, values, compression="zip", **told)
    assert attributes(path)["vrtm:inputs"] == told["vrtm:inputs"]
    painted = path.read_bytes()
    arguments = sheet_arguments(scene, tmp_path, "--frames", 1, "--warp")
    ended = run(*arguments, expect=2)
    assert "redirect.0001.1001.exr" in ended.stderr and "--overwrite" in ended.stderr and path.read_bytes() == painted
    assert written(run(*arguments, "--overwrite")) == (1, 3)
    assert files(tmp_path) == before
    for name in before:
        # Another tile's file under this name.
        other = "redirect.0001.1002.exr" if name == "redirect.0001.1001.exr" else "redirect.0001.1001.exr"
        (tmp_path / name).write_bytes(before[other])
        assert written(run(*sheet_arguments(scene, tmp_path, "--frames", 1, "--warp"))) == (1, 3)
        assert files(tmp_path) == before


def test_the_report(scene: Path, tmp_path: Path) -> None:
    path = tmp_path / "r.json"
    arguments = sheet_arguments(scene, tmp_path / "out", "--measure", "--report", path, "--texture-size", 1000)
    run(*arguments)
    first = json.loads(path.read_text())
    assert (first["written"], first["skipped"], first["exit_code"]) == (10, 0, 0)
    assert [(f["frame"], f["mesh"]) for f in first["frames"]] == [(n, "sheet") for n in range(1, 6)]
    tile = first["frames"][4]["tiles"][1]
    assert tile["udim"] == 1002 and tile["state"] == "written" and tile["folds"] == 0
    assert 0 < tile["energy"] < tile["energy_before"] and 0 < tile["min_jacobian"] < 1
    assert 0 < tile["strain"]["after"]["rms"] < tile["strain"]["before"]["rms"]
    assert 0 < tile["map"]["error_texels"]["p99"] < 1000
    assert tile["files"] == [{"path": "redirect.0005.1002.exr", "state": "written"}]
    # What is skipped has the same figures: they stand in the files.
    run(*arguments)
    second = json.loads(path.read_text())
    assert (second["written"], second["skipped"]) == (0, 10)

    for report in (first, second):
        for tile in (tile for frame in report["frames"] for tile in frame["tiles"]):
            del tile["state"], tile["files"]
    figures = [[(f["frame"], f["mesh"], f["tiles"]) for f in report["frames"]] for report in (first, second)]
    assert figures[0] == figures[1]


def test_tolerances(scene: Path, tmp_path: Path) -> None:
    out, options = tmp_path / "out", ("--max-strain", "--max-error")
    run(*sheet_arguments(scene, out, *(word for option in options for word in (option, "1000"))))
    for option in options:
        # Also where nothing is left to do.
        ended = run(*sheet_arguments(scene, out, option, "1e-6", "--report", tmp_path / "r.json"), expect=3)
        assert option in ended.stderr
        assert json.loads((tmp_path / "r.json").read_text())["exit_code"] == 3
    run(*sheet_arguments(scene, tmp_path / "new", "--max-strain", "1e-6", "--jobs", 2), expect=3)
    assert len(files(tmp_path / "new")) == 10


def test_bad_input(scene: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    blocked = tmp_path / "file"
    blocked.write_text("in the way")
    bad = tmp_path / "bad.usda"
    bad.write_text("#usda 1.0\ndef Mesh {")
    obj = tmp_path / "a.obj"
    obj.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n")
    good, layer = sheet_arguments(scene, out), ("--layer", tmp_path / "l.usda")
    rigid = good[:1] + good[2:]
    for arguments, words in [
        ([*good, "--frames", "9-8"], "runs backwards"),
        ([*good, "--frames", "100-200"], "1-5"),
        ([*good, "--tiles", "1050"], "1001, 1002"),
        ([*good, "--name", "a.exr"], "--name a.exr"),
        ([*good, "--name", f"{'a' * 220}<frame>.<UDIM>.exr"], "its name has 233 bytes, more than 232"),
        ([*good, "--frames", "1-"], "--frames: '1-' is neither a number nor a range"),
        ([*good, "--meshes", "sheeet"], "did you mean sheet?"),
        ([*good, "--uv", "st0", "--meshes", "sheet"], "has no UVs 'st0': did you mean st?"),
        ([*good, "--qualty", "draft"], "did you mean --quality?"),
        ([*good, "--quality", "best"], "invalid choice: 'best'"),
        ([*rigid[:1], scene, "--rigidity-primvar", "Prev", "--out", out], "rigidity: did you mean Pref?"),
        ([*good, "--size", "0"], "--size"),
        ([*good, "--max-strain", "nan"], "--max-strain"),
        ([*good, "--texture", tmp_path / "none.<UDIM>.png"], "none.<UDIM>.png"),
        ([*good, "--mask", blocked], str(blocked)),
        ([*good, "--rigidity-primvar", "x"], "--rigidity"),
        ([*good, "--more", "'unclosed"], "--more"),
        ([*good, "--settings", tmp_path / "none.txt"], "none.txt"),
        ([*good, "--report", blocked / "r.json"], "r.json"),
        ([*good, "--form", "tile", *layer], "use 'udim'"),
        ([*good, "--layer", tmp_path / "l.txt"], "l.txt: its name must end in one of .usda"),
        (["bake", obj, *rigid[1:], *layer], "a.obj is no USD file"),
        (["bake", scene, "--out", out], "--rigidity"),
        (["bake", tmp_path / "none.usda", *rigid[1:]], "none.usda"),
        (["bake", bad, *rigid[1:]], "bad.usda"),
        (["bake", blocked, *rigid[1:]], str(blocked)),
        (sheet_arguments(scene, blocked), str(blocked)),
        (sheet_arguments(scene, blocked / "below"), str(blocked)),
        (sheet_arguments(scene, "/proc/nothing"), "/proc/nothing"),
    ]:
        ended = run(*arguments, expect=2)
        (line,) = ended.stderr.strip().splitlines()
        assert words in line, f"'{words}' in: {line}"
        assert "Traceback" not in ended.stderr and "[1/5]" not in ended.stdout, "known before the first solve"
        assert "--layer" not in arguments or not out.exists(), "known before a folder is made"
        shutil.rmtree(out, ignore_errors=True)
    assert not list(tmp_path.glob("l.*"))


def test_devices(scene: Path, tmp_path: Path) -> None:
    ended = run("devices")
    assert ended.stdout.startswith("cpu")
    ended = run(*sheet_arguments(scene, tmp_path, "--device", "gpu", "--adapter", 200), expect=4)
    assert "--device gpu" in ended.stderr and files(tmp_path) == {}
    assert run("--version").stdout == f"vrtm {vrtm.version()}\n"


def test_missing_modules_are_named(scene: Path, tmp_path: Path) -> None:
    for module in ("OpenImageIO", "pxr"):
        blocker = tmp_path / module
        blocker.mkdir()
        (blocker / "sitecustomize.py").write_text(f"import sys; sys.modules['{module}'] = None\n")
        command, variables = vrtm_command(*sheet_arguments(scene, tmp_path / "out"))
        variables["PYTHONPATH"] = f"{blocker}{os.pathsep}{variables['PYTHONPATH']}"
        ended = subprocess.run(command, env=variables, capture_output=True, text=True)
        assert ended.returncode == 2, ended.stderr
        assert len(ended.stderr.splitlines()) == 1 and "pip install 'vrtm[bake]'" in ended.stderr


@pytest.mark.parametrize(
    ("redirected", "jobs"),
    [
        *((by, 1) for by in ("1>&-", "2>&-", "1>/dev/full", "| true")),
        *((by, 2) for by in ("1>&- 2>&- 0<&-", "1>/dev/full 2>/dev/full")),
    ],
)
def test_what_is_printed_cannot_do_harm(scene: Path, tmp_path: Path, redirected: str, jobs: int) -> None:
    report = tmp_path / "report.json"
    arguments = sheet_arguments(scene, tmp_path / "out", "--tiles", 1001, "--frames", "1-2,9")
    command, variables = vrtm_command(*arguments, "--jobs", jobs, "--report", report)
    line = " ".join(f"'{word}'" for word in command) + f" {redirected}"
    ended = subprocess.run(["bash", "-o", "pipefail", "-c", line], env=variables, capture_output=True, text=True)
    # The report tells what the streams could not.
    assert ended.returncode == 0, f"{ended.stderr}{report.read_text() if report.exists() else 'no report'}"[-2000:]
    assert len(files(tmp_path / "out")) == 2 and "Traceback" not in ended.stderr
    assert written(run(*arguments)) == (0, 2)


def test_two_bakes_into_one_folder(scene: Path, tmp_path: Path) -> None:
    run(*sheet_arguments(scene, tmp_path / "alone"))
    command, variables = vrtm_command(*sheet_arguments(scene, tmp_path / "both"))
    both = [subprocess.Popen(command, env=variables, stdout=subprocess.DEVNULL) for _ in range(2)]
    assert [process.wait(120) for process in both] == [0, 0]
    assert files(tmp_path / "both") == files(tmp_path / "alone")


def test_messages(scene: Path, tmp_path: Path) -> None:
    lines = run(*sheet_arguments(scene, tmp_path / "a")).stdout.splitlines()
    # The device, the rest, what happens at borders, a line per frame, one more for each tile that is met first, the
    # mesh's, and the last one.
    assert len(lines) == 12 and lines[9].startswith("[5/5] sheet, frame ")
    assert lines[0].startswith("device: cpu, ") and lines[1] == "rest: Pref: /model/sheet"
    assert len([line for line in lines if "of the rigid texels are fixed" in line]) == 2
    of_mesh = r"/model/sheet: 5 frames \(1-5\), strain 0\.\d+ -> 0\.\d+ RMS \(frame 5, the worst of 3 measured: .*, 10 "
    assert re.match(of_mesh + "files", lines[10])
    # No bar, and no line per frame.
    plain = run(*sheet_arguments(scene, tmp_path / "b", "--no-progress")).stdout.splitlines()
    assert plain[:5] == [line for line in lines if not line.startswith("[")][:5] and len(plain) == 7
    assert run(*sheet_arguments(scene, tmp_path / "c", "--quiet")).stdout == ""
    lines = run(*sheet_arguments(scene, tmp_path / "d", "--openjd")).stdout.splitlines()
    told = [line.split()[1] for line in lines if line.startswith("openjd_progress: ")]
    assert told == ["0.0", "20.0", "40.0", "60.0", "80.0", "100.0"]
    ended = run(*sheet_arguments(scene, tmp_path / "e", "--openjd", "--tiles", 1099), expect=2)
    assert "openjd_fail: --tiles" in ended.stdout
    further, settings = "--half --name '<kind> <UDIM> <frame>.exr' --frames", tmp_path / "settings.txt"
    settings.write_text(f"{further}\n1-5\n")
    for k, given in enumerate([[f"--more={further} 2"], ["--settings", settings, "--frames", 2]]):
        more = run(*sheet_arguments(scene, tmp_path / f"f{k}", *given))
        assert written(more) == (2, 0) and sorted(files(tmp_path / f"f{k}"))[0] == "redirect 1001 0002.exr"


def test_names_that_are_not_ascii(tmp_path: Path) -> None:
    scene = sheet(tmp_path / "Gesicht \u00e4\u5b57", frames=2, cells=4)
    out = scene.parent / "out"
    arguments = sheet_arguments(scene, out, "--texture", scene.parent / "colour.<UDIM>.png", "--report", out / "r.json")
    for name, jobs in (("C", 2), ("C.UTF-8", 1)):
        variables = {"LC_ALL": name, "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
        shutil.rmtree(out, ignore_errors=True)
        ended = run(*arguments, "--jobs", jobs, **variables)
        assert written(ended) == (8, 0) and ended.stderr == ""
        assert len(files(out)) == 9
    # One that is no UTF-8 cannot be passed on.
    other = os.fsdecode(os.fsencode(tmp_path) + b"/\xff")
    shutil.copytree(scene.parent, other)
    ended = run(*sheet_arguments(Path(other) / scene.name, out), expect=2)
    assert len(ended.stderr.splitlines()) == 1 and "no UTF-8" in ended.stderr
