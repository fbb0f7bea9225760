#!/usr/bin/env python3
"""Makes the add-on's archive, which Blender installs as an extension: the add-on, the licences, and the Python
package `vrtm` as a wheel, since an extension must not need the network.

    python3 build.py                        # builds the wheel out of ../python with pip, which takes Rust
    python3 build.py --wheel vrtm-*.whl     # takes wheels that are there, one per platform

The variable VRTM_LIBRARY names a shared library that is built already (cargo build --release -p vrtm-c): without Rust.
Writes vrtm-<version>-<platform>.zip for each wheel. The same inputs make the same bytes.
"""

from __future__ import annotations

import argparse
import ast
import email.parser
import io
import os
import re
import subprocess
import sys
import tempfile
import tomllib
import zipfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
SOURCE = HERE / "vrtm_blender"
REPOSITORY = HERE.parents[1]
sys.path.insert(0, str(REPOSITORY / "bindings" / "python"))
from platforms import by_head, file_name, fits  # noqa: E402

LICENCES = ("LICENSE-MIT", "LICENSE-APACHE")

# By what the platform of a wheel ends or begins with: the platform as Blender's manifest has it.
PLATFORMS = [
    (r"(many|musl)?linux.*_x86_64", ["linux-x64"]),
    (r"(many|musl)?linux.*_aarch64", ["linux-arm64"]),
    (r"win_amd64", ["windows-x64"]),
    (r"win_arm64", ["windows-arm64"]),
    (r"macosx_.*_arm64", ["macos-arm64"]),
    (r"macosx_.*_x86_64", ["macos-x64"]),
    (r"macosx_.*_universal2", ["macos-arm64", "macos-x64"]),
]
LIBRARY = re.compile(r"\.(so|dylib|dll|pyd)(\.\d+)*$")


class Refused(Exception):
    """An input that cannot be packed; the text names it."""


def platforms_of(wheel: Path) -> list[str]:
    """The platforms of a wheel, by its name: name-version-python-abi-platform.whl, where a dot parts several
    platforms."""
    parts = wheel.name.removesuffix(".whl").split("-")
    if wheel.suffix != ".whl" or len(parts) not in (5, 6):
        raise Refused(f"{wheel}: its name is not that of a wheel")
    if parts[-3] != "py3" or parts[-2] != "none":
        raise Refused(
            f"{wheel}: it is for one version of Python only; one for all of Blender's is named ...-py3-none-..."
        )
    found = {
        p for tag in parts[-1].split(".") for pattern, names in PLATFORMS if re.fullmatch(pattern, tag) for p in names
    }
    if not found:
        raise Refused(f"{wheel}: {parts[-1]} is none of Blender's platforms")
    return sorted(found)


def check_wheel(wheel: Path, version: str) -> None:
    """Refuses a wheel that is not the package vrtm of this version, lacks the library for its platform, or needs more
    than numpy."""
    tag = wheel.name.removesuffix(".whl").split("-")[-1]
    library = f"vrtm/{file_name(tag)}"
    try:
        with zipfile.ZipFile(wheel) as archive:
            names = archive.namelist()
            metadata = next((n for n in names if n.count("/") == 1 and n.endswith(".dist-info/METADATA")), None)
            if metadata is None:
                raise Refused(f"{wheel}: it has no METADATA")
            about = email.parser.Parser().parsestr(archive.read(metadata).decode())
            head = archive.read(library)[:4096] if library in names else b""
    except (OSError, zipfile.BadZipFile) as error:
        raise Refused(f"{wheel}: {error}") from error
    if about["Name"] != "vrtm" or about["Version"] != version:
        raise Refused(f"{wheel}: it is {about['Name']} {about['Version']}, and the add-on takes vrtm {version}")
    libraries = [name for name in names if name.startswith("vrtm/") and LIBRARY.search(name)]
    if not libraries:
        raise Refused(f"{wheel}: there is no library in it")
    found = by_head(head)
    if libraries != [library] or found is None or not fits(tag, *found):
        raise Refused(f"{wheel}: {', '.join(libraries)} is no library for {tag}")
    needed = [line for line in about.get_all("Requires-Dist", []) if "extra ==" not in line]
    others = [line for line in needed if not re.match(r"numpy\b", line)]
    if others:
        raise Refused(f"{wheel}: it needs {', '.join(others)}, which Blender does not have")


def manifest(wheels: list[str], platforms: list[str]) -> str:
    """The manifest with its wheels and platforms, which stand before the first table."""
    lines = (SOURCE / "blender_manifest.toml").read_text(encoding="utf-8").splitlines()
    lines = lines[next(i for i, line in enumerate(lines) if line and not line.startswith("#")) :]
    first = next((i for i, line in enumerate(lines) if line.startswith("[")), len(lines))
    added = [f"platforms = {toml_list(platforms)}", f"wheels = {toml_list(f'./wheels/{name}' for name in wheels)}", ""]
    return "\n".join(lines[:first] + added + lines[first:]) + "\n"


def toml_list(values) -> str:
    return "[" + ", ".join(f'"{value}"' for value in values) + "]"


def sources() -> dict[str, bytes]:
    """The add-on's files by their names in the archive."""
    files = {path.relative_to(SOURCE).as_posix(): path.read_bytes() for path in SOURCE.rglob("*.py")}
    for name, data in files.items():
        # Blender 4.2 has Python 3.11.
        ast.parse(data, name, feature_version=(3, 11))
    files["README.md"] = (HERE / "README.md").read_bytes()
    for name in LICENCES:
        files[name] = (REPOSITORY / name).read_bytes()
    return files


def pack(wheel: Path) -> tuple[str, bytes]:
    """The archive for a wheel: its name and its bytes."""
    version = tomllib.loads((SOURCE / "blender_manifest.toml").read_text(encoding="utf-8"))["version"]
    platforms = platforms_of(wheel)
    check_wheel(wheel, version)
    files = sources()
    files["blender_manifest.toml"] = manifest([wheel.name], platforms).encode()
    files[f"wheels/{wheel.name}"] = wheel.read_bytes()
    held = io.BytesIO()
    with zipfile.ZipFile(held, "w") as archive:
        for name in sorted(files):
            # No time, owner or system of the machine that packs: the same files are the same archive.
            entry = zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0))
            entry.create_system, entry.external_attr = 3, 0o644 << 16
            # A wheel is compressed already.
            entry.compress_type = zipfile.ZIP_STORED if name.endswith(".whl") else zipfile.ZIP_DEFLATED
            archive.writestr(entry, files[name])
    return f"vrtm-{version}-{'-'.join(platforms).replace('-', '_')}.zip", held.getvalue()


def build_wheel(folder: Path) -> Path:
    package = REPOSITORY / "bindings" / "python"
    given = os.environ.get("VRTM_LIBRARY")
    print(f"the library: {given}" if given else "building the library, which takes some minutes", flush=True)
    # Verbose: pip shows what cargo is at.
    command = [sys.executable, "-m", "pip", "wheel", "--verbose", "--no-deps", "--wheel-dir", str(folder), str(package)]
    if subprocess.run(command, check=False).returncode != 0:
        raise Refused(f"{package}: pip could not build the wheel; what it said stands above")
    return next(folder.glob("vrtm-*.whl"))


def main() -> int:
    parser = argparse.ArgumentParser(description="Makes the archive that Blender installs as an extension.")
    parser.add_argument(
        "--wheel", type=Path, nargs="+", help="wheels of the Python package vrtm; built with pip if left out"
    )
    parser.add_argument("--out", type=Path, default=HERE / "dist", help="where to write the archives (%(default)s)")
    arguments = parser.parse_args()
    try:
        with tempfile.TemporaryDirectory() as folder:
            for wheel in arguments.wheel or [build_wheel(Path(folder))]:
                name, data = pack(wheel)
                arguments.out.mkdir(parents=True, exist_ok=True)
                path = arguments.out / name
                path.write_bytes(data)
                print(f"{path} ({len(data) / 1e6:.1f} MB)")
    except (Refused, OSError) as error:
        print(f"build.py: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
