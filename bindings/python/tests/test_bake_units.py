"""Parts of the console command: lists of frames, names, temporary files, exit codes."""

import errno
import fcntl
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import vrtm
from conftest import refused
from vrtm.bake import frames, staging
from vrtm.bake.failure import BUG, DEVICE, INPUT, Failure, describe
from vrtm.bake.fingerprint import Fingerprint
from vrtm.bake.names import Pattern
from vrtm.bake.scene import SceneError


@pytest.mark.parametrize(
    ("text", "numbers"),
    [
        ("5", (5,)),
        ("1-4", (1, 2, 3, 4)),
        ("1-10x2,15", (1, 3, 5, 7, 9, 15)),
        ("1-10:3", (1, 4, 7, 10)),
        (" 3 , 1-2 ", (1, 2, 3)),
        ("1 2  3\t5 - 9 x 2,10 01", (1, 2, 3, 5, 7, 9, 10)),
        ("1.5 2 0.5", (0.5, 1.5, 2)),
        ("-3--1", (-3, -2, -1)),
        ("-1-1", (-1, 0, 1)),
        ("2,2,1-3", (1, 2, 3)),
        ("1.5", (1.5,)),
        ("1-2x0.25", (1, 1.25, 1.5, 1.75, 2)),
        ("0-1:0.1,3.0", (0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1, 3)),
    ],
)
def test_lists_of_frames(text: str, numbers: tuple[int, ...]) -> None:
    assert frames.parse(text) == numbers
    assert frames.parse(frames.text(numbers)) == numbers


@pytest.mark.parametrize("text", ["", "a", "1-", "3-1", "1-5x0", "1,,2", "1.", ".5", "1-2-3", "1-99999999999", "1 -3"])
def test_wrong_lists_of_frames(text: str) -> None:
    refused(ValueError, "", frames.parse, text)


def test_frames_are_clamped_to_the_scene() -> None:
    assert frames.clamp(None, (1, 2, 3)) == ((1, 2, 3), ())
    assert frames.clamp((0, 2, 3, 9), (1, 2, 3)) == ((2, 3), (0, 9))
    assert frames.text((1, 2, 3, 7, 9, 10)) == "1-3,7,9-10"
    # What lies between two frames, where the scene has that.
    wanted = (0.5, 1, 1.5, 3, 3.5)
    assert frames.clamp(wanted, (1, 2, 3)) == ((1, 3), (0.5, 1.5, 3.5))
    assert frames.clamp(wanted, (1, 2, 3), between=True) == ((1, 1.5, 3), (0.5, 3.5))
    assert frames.text((1, 1.5, 2, 3)) == "1,1.5,2-3"


def test_tiles_are_whole_numbers() -> None:
    assert frames.parse_whole("1001-1003x2 1011") == (1001, 1003, 1011)
    refused(ValueError, r"1001\.5 is not a whole number", frames.parse_whole, "1001.5")


WRONG = r"/a.exr ../a.exr a/../b.exr a.png .exr a/ <other>.exr <fra a\b.exr a//b.exr <kind>.exr "
WRONG += "<frame>$F4.exr <frame>%04d.exr <frame>####.exr <frame>.%(UDIM)d.exr"


@pytest.mark.parametrize("text", WRONG.split())
def test_wrong_names(text: str) -> None:
    with pytest.raises(Failure) as caught:
        Pattern(text, {"<frame>": 2})
    assert caught.value.code == INPUT and text in str(caught.value)


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (SceneError("shot.usd /head: no UVs"), INPUT),
        (FileNotFoundError(errno.ENOENT, "No such file", "a.png"), INPUT),
        (OSError(errno.ENOSPC, "No space left on device", "a.exr"), INPUT),
        (ModuleNotFoundError("No module named 'pxr'", name="pxr"), INPUT),
        (ImportError("libGL.so.1: cannot open shared object file", name="OpenImageIO"), INPUT),
        (ImportError("cannot import name 'Frame' from 'vrtm.bake.frames'", name="vrtm.bake.frames"), BUG),
        (vrtm.InvalidArgumentError(1, "VRTM_ERROR_INVALID_ARGUMENT", "positions[3]: NaN"), INPUT),
        (vrtm.UnsupportedError(3, "VRTM_ERROR_UNSUPPORTED", "no GPU"), DEVICE),
        (vrtm.OutOfMemoryError(4, "VRTM_ERROR_OUT_OF_MEMORY", "12 bytes"), DEVICE),
        (vrtm.DeviceLostError(7, "VRTM_ERROR_DEVICE_LOST", "gone"), DEVICE),
        (MemoryError(), DEVICE),
        (Failure(143, "ended"), 143),
        (ZeroDivisionError("a defect"), BUG),
        (vrtm.InternalError(8, "VRTM_ERROR_INTERNAL", "a defect"), BUG),
    ],
)
def test_exit_codes(error: Exception, code: int) -> None:
    failure = describe(error, "the subject")
    assert failure.code == code
    assert code == BUG or "\n" not in failure.message


def test_fingerprints_tell_inputs_apart() -> None:
    a = np.arange(6, dtype=np.float32)
    distinct = [
        Fingerprint().text("a", "b"),
        Fingerprint().text("ab", ""),
        Fingerprint().array(a),
        Fingerprint().array(a.reshape(2, 3)),
        Fingerprint().array(a.astype(np.float64)),
        Fingerprint().array(None),
        Fingerprint().array(a[:0]),
    ]
    assert len({found.hex() for found in distinct}) == len(distinct)
    # Not by how an array lies in memory.
    wide = np.zeros((6, 2), np.float32)
    wide[:, 0] = a
    assert Fingerprint().array(wide[:, 0]).hex() == Fingerprint().array(a).hex()
    assert Fingerprint().array(a.astype(">f4")).hex() == Fingerprint().array(a).hex()


def test_files_have_the_modes_of_files(tmp_path: Path) -> None:
    staging.write_bytes(str(tmp_path / "a"), b"x")
    (tmp_path / "b").write_bytes(b"x")
    assert (tmp_path / "a").stat().st_mode == (tmp_path / "b").stat().st_mode


def test_a_sweep_takes_what_nobody_writes(tmp_path: Path) -> None:
    program = (
        "import os, sys, time; from vrtm.bake import staging\n"
        "def body(path): open(path, 'w').write('x'); print(os.path.realpath(path), flush=True); time.sleep(100)\n"
        "staging.write(sys.argv[1], body)"
    )
    started = [
        subprocess.Popen([sys.executable, "-c", program, str(tmp_path / name)], stdout=subprocess.PIPE, text=True)
        for name in ("dead", "alive")
    ]
    paths = [process.stdout.readline().strip() for process in started]
    started[0].kill()
    started[0].wait()
    others = [tmp_path / ".mine.part", tmp_path / ".redirect.exr.1234.part"]
    for other in others:
        other.write_text("not ours")
    try:
        assert staging.sweep(str(tmp_path)) == [paths[0]]
        assert not os.path.exists(paths[0]) and os.path.exists(paths[1]) and all(p.exists() for p in others)
    finally:
        started[1].kill()
        started[1].wait()
    with open(paths[1]) as locked:
        fcntl.flock(locked, fcntl.LOCK_EX)
        assert staging.sweep(str(tmp_path)) == []
    assert staging.sweep(str(tmp_path)) == [paths[1]]
