"""Platform of a shared library, as the tags of wheels name it, and the library's name in the package there."""

import re
import struct
from pathlib import Path

# The numbers of processors in the heads of libraries.
PE = {0x8664: "win_amd64", 0xAA64: "win_arm64"}
ELF = {62: "x86_64", 183: "aarch64"}
MACH_O = {0x01000007: "x86_64", 0x0100000C: "arm64"}


def file_name(tag: str) -> str:
    """Name of the library in a wheel for this platform, as vrtm/_library.py looks for it."""
    if tag.startswith(("win", "mingw")):
        return "vrtm.dll"
    return "libvrtm.dylib" if tag.startswith("macosx") else "libvrtm.so"


def system_of(library: Path) -> tuple[str, str]:
    """The system that a library is for ("win", "linux", "macosx"), and its processor; SystemExit if it is none that is
    known here."""
    with library.open("rb") as file:
        found = by_head(file.read(4096))
    if found is None:
        raise SystemExit(f"vrtm: {library} is no shared library for a system that wheels are made for")
    return found


def by_head(head: bytes) -> tuple[str, str] | None:
    """The same by the library's first 4096 bytes."""
    if head[:2] == b"MZ" and len(head) >= 64:
        (at,) = struct.unpack_from("<I", head, 60)
        if head[at : at + 4] == b"PE\0\0" and len(head) >= at + 6:
            (machine,) = struct.unpack_from("<H", head, at + 4)
            if machine in PE:
                return "win", PE[machine].removeprefix("win_")
    elif head[:6] == b"\x7fELF\x02\x01":
        (machine,) = struct.unpack_from("<H", head, 18)
        if machine in ELF:
            return "linux", ELF[machine]
    elif head[:4] == b"\xcf\xfa\xed\xfe":
        (machine,) = struct.unpack_from("<I", head, 4)
        if machine in MACH_O:
            return "macosx", MACH_O[machine]
    elif head[:4] == b"\xca\xfe\xba\xbe":
        return "macosx", "universal2"
    return None


def tag_for(library: Path, wanted: str, here: str) -> str:
    """The wheel's platform tag. `wanted` is what VRTM_WHEEL_PLATFORM says, or empty; `here` is this machine's tag. A
    library for another system has that system's, so that a wheel for Windows is made on Linux, too."""
    system, processor = system_of(library)
    if wanted:
        if not fits(wanted, system, processor):
            raise SystemExit(f"vrtm: VRTM_WHEEL_PLATFORM is {wanted}, but {library} is for {system}_{processor}")
        return wanted
    if fits(here, system, processor):
        return here
    if system != "macosx":
        return f"{system}_{processor}"
    # Python itself is often for both processors.
    version = re.fullmatch(r"macosx_(\d+)_(\d+)_.*", here)
    if version is None:
        raise SystemExit(
            f"vrtm: {library} is for macOS: set VRTM_WHEEL_PLATFORM, such as macosx_11_0_{processor}, which names the "
            "oldest version that it is for"
        )
    oldest = max((int(version[1]), int(version[2])), (11, 0) if processor == "arm64" else (10, 9))
    return f"macosx_{oldest[0]}_{oldest[1]}_{processor}"


def fits(tag: str, system: str, processor: str) -> bool:
    """True if a library may stand in a wheel with this tag: a universal one serves each of its processors."""
    kind = {"win": r"(win|mingw)", "linux": r"(many|musl)?linux(\d+)?", "macosx": "macosx"}[system]
    name = processor
    if (system, processor) == ("win", "amd64"):
        name = r"(amd64|x86_64(_ucrt|_msvcrt|_clang|_gnu|_llvm)*)"
    elif processor == "universal2":
        name = "(universal2|x86_64|arm64)"
    return all(re.fullmatch(rf"{kind}(_.*)?_{name}", part) for part in tag.split("."))
