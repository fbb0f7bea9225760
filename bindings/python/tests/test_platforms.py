"""Wheels: for the platform of their library, on whichever system they are made; and their description."""

import os
import struct
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(PACKAGE), str(PACKAGE.parent)]
import links  # noqa: E402
import platforms  # noqa: E402

HERE = "linux_x86_64"


def library(kind: str, processor: int) -> bytes:
    """The head of a shared library."""
    if kind == "pe":
        return b"MZ".ljust(60, b"\0") + struct.pack("<I64x4sH64x", 128, b"PE\0\0", processor)
    if kind == "elf":
        return b"\x7fELF\x02\x01\x01" + bytes(9) + struct.pack("<HH64x", 3, processor)
    return b"\xcf\xfa\xed\xfe" + struct.pack("<I64x", processor)


def name_of(value: object) -> str | None:
    """Libraries are no part of a test's name."""
    return "" if isinstance(value, bytes) else None


DLL = library("pe", 0x8664)
ARM_DLL = library("pe", 0xAA64)
SO = library("elf", 62)
ARM_SO = library("elf", 183)
DYLIB = library("macho", 0x0100000C)


def tag(folder: Path, data: bytes, wanted: str = "", here: str = HERE) -> str:
    path = folder / "library"
    path.write_bytes(data)
    return platforms.tag_for(path, wanted, here)


@pytest.mark.parametrize(
    ("data", "wanted", "here", "expected"),
    [
        (SO, "", HERE, HERE),
        (DLL, "", HERE, "win_amd64"),
        (ARM_DLL, "", HERE, "win_arm64"),
        (ARM_SO, "", HERE, "linux_aarch64"),
        (DLL, "", "win_amd64", "win_amd64"),
        (ARM_DLL, "", "win_amd64", "win_arm64"),
        (DLL, "", "mingw_x86_64_ucrt", "mingw_x86_64_ucrt"),
        (SO, "manylinux_2_35_x86_64", HERE, "manylinux_2_35_x86_64"),
        (SO, "manylinux_2_17_x86_64.manylinux2014_x86_64", HERE, "manylinux_2_17_x86_64.manylinux2014_x86_64"),
        (ARM_SO, "manylinux_2_36_aarch64", HERE, "manylinux_2_36_aarch64"),
        (DYLIB, "macosx_12_0_arm64", HERE, "macosx_12_0_arm64"),
        (DYLIB, "", "macosx_11_0_arm64", "macosx_11_0_arm64"),
        (DYLIB, "", "macosx_10_13_universal2", "macosx_11_0_arm64"),
        (DYLIB, "", "macosx_14_0_x86_64", "macosx_14_0_arm64"),
    ],
    ids=name_of,
)
def test_the_tag_is_the_library_s(tmp_path, data, wanted, here, expected):
    assert tag(tmp_path, data, wanted, here) == expected


@pytest.mark.parametrize(
    ("data", "wanted", "text"),
    [
        (DLL, "manylinux_2_35_x86_64", "VRTM_WHEEL_PLATFORM is manylinux_2_35_x86_64, but .* is for win_amd64"),
        (ARM_SO, "manylinux_2_35_x86_64", "is for linux_aarch64"),
        (SO, "manylinux_2_35_x86_64.win_amd64", "is for linux_x86_64"),
        (DYLIB, "", "set VRTM_WHEEL_PLATFORM, such as macosx_11_0_arm64"),
        (b"", "", "is no shared library"),
        (b"!<arch>\n", "", "is no shared library"),
        (library("elf", 40), "", "is no shared library"),
        (DLL[:130], "", "is no shared library"),
    ],
    ids=name_of,
)
def test_a_library_for_another_platform_is_refused(tmp_path, data, wanted, text):
    with pytest.raises(SystemExit, match=text):
        tag(tmp_path, data, wanted)


def test_a_library_that_does_not_load_is_named(tmp_path):
    path = tmp_path / "library"
    path.write_bytes(ARM_DLL)
    environment = {**os.environ, "VRTM_LIBRARY": str(path)}
    found = subprocess.run([sys.executable, "-c", "import vrtm"], capture_output=True, text=True, env=environment)
    assert found.returncode != 0
    assert f"ImportError: vrtm: the shared library {path} does not load on " in found.stderr


TEXT = """\
![A picture](../../docs/images/sheet.png) of [this](
../README.md#a-b), [here](#there), and [there](https://example.org/a).
"""


def test_links_of_the_description(tmp_path, monkeypatch):
    """They lead into the repository, or are text."""
    file = tmp_path / "one" / "two" / "README.md"
    file.parent.mkdir(parents=True)
    file.write_text(TEXT)
    monkeypatch.setattr(links, "ROOT", tmp_path)
    monkeypatch.delenv("VRTM_REPOSITORY", raising=False)
    assert links.absolute(file, "1.2") == " of this, here, and [there](https://example.org/a).\n"
    monkeypatch.setenv("VRTM_REPOSITORY", "https://example.org/v/")
    assert links.absolute(file, "1.2") == (
        "![A picture](https://example.org/v/raw/v1.2/docs/images/sheet.png) of "
        "[this](https://example.org/v/blob/v1.2/one/README.md#a-b), "
        "[here](https://example.org/v/blob/v1.2/one/two/README.md#there), and [there](https://example.org/a).\n"
    )
