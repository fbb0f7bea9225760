"""Bakes that are ended at any moment: nothing half-written stays, nobody is left behind, and the next run goes on.
Bakes on a full disk leave whole files or none, and an exit code that tells."""

import contextlib
import io
import json
import os
import resource
import signal
import subprocess
import time
from pathlib import Path

import pytest

from bake_scenes import files, image, pixels, processes, run, sheet, sheet_arguments, vrtm_command, with_material
from conftest import LONG, refused, until
from scenes import preview_material
from vrtm.bake import staging
from vrtm.cli import main

# A few seconds of work: long enough to be interrupted, short enough to be done again by each test.
FRAMES = 8
OPTIONS = ("--size", 128, "--warp", "--jacobian")


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return sheet(tmp_path_factory.mktemp("sheet"), frames=FRAMES)


@pytest.fixture(scope="module")
def reference(scene: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    out = tmp_path_factory.mktemp("reference")
    run(*sheet_arguments(scene, out, *OPTIONS))
    return files(out)


def begin(scene: Path, out: Path, jobs: int) -> subprocess.Popen[str]:
    """A bake in a session of its own, so that its processes can be found."""
    command, variables = vrtm_command(*sheet_arguments(scene, out, *OPTIONS, "--jobs", jobs))
    # What a shell starts with & ignores SIGINT, and so would all that it starts.
    return subprocess.Popen(
        command,
        env=variables,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )


def left(session: int) -> list[int]:
    """Processes of a session that are alive."""
    return [number for number, (state, _, own) in processes().items() if own == session and state != "Z"]


def await_files(out: Path, process: subprocess.Popen[str], count: int) -> None:
    """Waits until so many files are there; for none, until the scene is being opened."""
    opened = Path(f"/proc/{process.pid}/maps")
    while process.poll() is None and (
        (not out.is_dir() or len(os.listdir(out)) < count) if count else "usd" not in opened.read_text()
    ):
        time.sleep(0.005)


def end_early(process: subprocess.Popen[str], out: Path, number: int, code: int, count: int, group: bool) -> bool:
    """Sends a bake a signal once so many files are there. False if it was done before."""
    await_files(out, process, count)
    # As a terminal does with Ctrl-C, and schedulers with SIGTERM: to all processes, or to the first.
    with contextlib.suppress(ProcessLookupError):
        (os.killpg if group else os.kill)(process.pid, number)
    _, told = process.communicate(timeout=100)
    if process.returncode == 0:
        return False
    assert process.returncode == code, told
    assert "Traceback" not in told and f"ended by {signal.Signals(number).name}" in told
    until(lambda: not left(process.pid))
    return True


# Each signal in each way of working, at one of the times; in the long run all of them at all times.
ENDS = {"SIGTERM": 143, "SIGINT": 130, "SIGHUP": 129}
SOME = [(1, False, "SIGHUP", 16), (2, False, "SIGTERM", 4), (2, True, "SIGINT", 0), (2, True, "SIGTERM", 16)]
ALL = [(*way, name, count) for way in ((1, False), (2, False), (2, True)) for name in ENDS for count in (0, 4, 16)]


@pytest.mark.parametrize(("jobs", "group", "name", "count"), ALL if LONG else SOME)
def test_a_signal_leaves_whole_files_alone(
    scene: Path, reference: dict[str, bytes], tmp_path: Path, jobs: int, group: bool, name: str, count: int
) -> None:
    for attempt in range(5):
        out = tmp_path / str(attempt)
        if end_early(begin(scene, out, jobs), out, signal.Signals[name], ENDS[name], count, group):
            break
        # On a busy machine the bake can be over before the signal comes; one that does not hear it always is.
        assert files(out) == reference
    else:
        pytest.fail(f"{name} ended none of five bakes")
    found = files(out) if out.is_dir() else {}
    assert len(found) < len(reference)
    assert found.items() <= reference.items(), sorted(set(found) - set(reference))


EARLY = """
import importlib.abc, os, signal, sys

class Interrupting(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path, target=None):
        if name == sys.argv[1]:
            os.kill(os.getpid(), signal.SIGINT)

sys.meta_path.insert(0, Interrupting())
from vrtm.cli import main
sys.exit(main(sys.argv[2:]))
"""


@pytest.mark.parametrize("jobs", [1, 2])
def test_a_kill_is_made_good_by_the_next_run(
    scene: Path, reference: dict[str, bytes], tmp_path: Path, jobs: int
) -> None:
    for count in (1, 12):
        process = begin(scene, tmp_path, jobs)
        await_files(tmp_path, process, count)
        process.kill()
        process.communicate()
        # The workers notice that they are alone, and end.
        until(lambda process=process: not left(process.pid))
        whole = {name: content for name, content in files(tmp_path).items() if not name.startswith(".")}
        assert whole.items() <= reference.items()
    # As a kill in the middle of a file leaves it.
    (tmp_path / ".redirect.0001.1001.exr.0123456789abcdef.part").write_bytes(b"v/1")
    run(*sheet_arguments(scene, tmp_path, *OPTIONS))
    assert files(tmp_path) == reference


def test_a_worker_that_is_killed_is_told(scene: Path, reference: dict[str, bytes], tmp_path: Path) -> None:
    for number in (signal.SIGKILL, signal.SIGTERM):
        out = tmp_path / number.name
        process = begin(scene, out, 2)
        await_files(out, process, 2)
        for worker in left(process.pid):
            command = Path(f"/proc/{worker}/cmdline").read_bytes()
            if b"spawn_main" in command:
                os.kill(worker, number)
                break
        _, told = process.communicate(timeout=100)
        assert process.returncode == 4, told
        assert "--jobs" in told
        until(lambda process=process: not left(process.pid))
        assert len(files(out)) < len(reference)
    run(*sheet_arguments(scene, out, *OPTIONS))
    assert files(out) == reference


BUSY = """
import os, signal, sys, threading
from vrtm.bake.scene import Shape, usd, usd_stage
from vrtm.cli import main

def busy(*given, **named):
    os.kill(os.getpid(), signal.SIGTERM)
    # As long as a library reads a large file.
    threading.Event().wait()

places = {"hidden": (usd_stage, "hidden"), "shape": (usd.UsdMesh, "shape"), "asset": (Shape, "asset")}
owner, name = places[sys.argv[1]]
setattr(owner, name, busy)
main(sys.argv[2:])
"""


@pytest.mark.parametrize(
    ("code", "name", "command", "place"),
    [
        # While modules are being loaded, and while meshes are looked through.
        *((EARLY, "SIGINT", "bake", module) for module in ("vrtm.bake.arguments", "OpenImageIO", "pxr.Sdf")),
        (EARLY, "SIGINT", "dilate", "pxr.Gf"),
        *((BUSY, "SIGTERM", *at) for at in (("bake", "hidden"), ("bake", "shape"), ("dilate", "asset"))),
    ],
)
def test_a_signal_is_heard_before_the_first_frame(
    scene: Path, tmp_path: Path, code: str, name: str, command: str, place: str
) -> None:
    out = tmp_path / "out"
    given = ["dilate", scene, "--texture", scene.parent / "colour.<UDIM>.png", "--out", out]
    started, variables = vrtm_command(*(sheet_arguments(scene, out) if command == "bake" else given))
    ended = subprocess.run(
        [started[0], "-c", code, place, *started[3:]],
        env=variables,
        capture_output=True,
        text=True,
        timeout=60,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    assert (ended.returncode, ended.stderr) == (ENDS[name], f"vrtm: ended by {name}\n")
    assert not out.exists()


@pytest.fixture(scope="module")
def shot(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = with_material(tmp_path_factory.mktemp("sheet"), preview_material, 1)
    for udim in (1001, 1002):
        # A copy of an image of each format.
        image(path.parent / f"painted.{udim}.tif", pixels(path.parent / f"colour.{udim}.png"))
    return path


def all_kinds(shot: Path, folder: Path) -> list[object]:
    """A bake that writes each kind of file."""
    textures = [shot.parent / name for name in ("colour.<UDIM>.png", "painted.<UDIM>.tif")]
    more = ("--texture", *textures, "--layer", folder / "over.usda", "--layer-mode", "primvar")
    return sheet_arguments(shot, folder / "out", *more, "--report", folder / "report.json")


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


def test_files_are_whole_or_not_there(shot: Path, tmp_path: Path) -> None:
    whole = tmp_path / "whole"
    whole.mkdir()
    run(*all_kinds(shot, whole))
    expected = files(whole)
    sizes = {name: len(content) for name, content in expected.items()}
    assert {os.path.splitext(name)[1] for name in sizes} == {".exr", ".png", ".tif", ".usdc", ".usda", ".json"}
    # As much as each kind of file takes, and a few bytes less: the last flush is what fails then.
    kinds = {os.path.splitext(name)[1]: size for name, size in sizes.items()}
    for largest in sorted({size - less for size in kinds.values() for less in (1, 200)} | {min(sizes.values()) // 2}):
        folder = tmp_path / str(largest)
        folder.mkdir()
        code, told = limited(all_kinds(shot, folder), largest)
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


def test_a_damaged_file_is_not_left_on_a_full_disk(shot: Path, tmp_path: Path) -> None:
    run(*all_kinds(shot, tmp_path))
    expected = files(tmp_path)
    for name in ("out/redirect.0001.1001.exr", "out/colour.0001.1002.png", "out/corners.0001.usdc"):
        path = tmp_path / name
        for damage in (expected[name][: len(expected[name]) // 2], expected[name][:-3]):
            path.write_bytes(damage)
            code, told = limited(all_kinds(shot, tmp_path), 100)
            assert code == 2 and name in told, told
            # The report, too, is too large; but it is whole, and of an earlier run.
            left = files(tmp_path)
            assert name not in left and all(left[other] == expected[other] for other in left if other != "report.json")
            run(*all_kinds(shot, tmp_path))
            assert path.read_bytes() == expected[name]
    # One that is whole, and only out of date, stays until another is there.
    name = "out/redirect.0001.1001.exr"
    code, _ = limited([*all_kinds(shot, tmp_path), "--quality", "draft"], 1000)
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
    refused(OSError, "No space left", staging.write_bytes, str(tmp_path / "a"), b"another")
    assert files(tmp_path) == {"a": b"content"}
