"""Makes the Python package's wheel and the Blender add-on's archive with a library for another system, and looks at
what is in them; then a program for that system, run by an emulator, loads the library of the wheel as Python does.

    python wheel.py --library FILE --tag win_amd64 --platform windows-x64 --out FOLDER --program LOADS --version V
        [--run EMULATOR]

LOADS is loads.c, compiled. Python is one with hatchling, pycparser and pip.
"""

import argparse
import io
import os
import subprocess
import sys
import zipfile
from pathlib import Path

import tomllib

REPOSITORY = Path(__file__).resolve().parents[2]


def build(arguments: argparse.Namespace) -> Path:
    environment = {**os.environ, "VRTM_LIBRARY": str(arguments.library), "PYTHONDONTWRITEBYTECODE": "1"}
    environment.pop("VRTM_WHEEL_PLATFORM", None)
    wheel = [sys.executable, "-m", "pip", "wheel", "--quiet", "--disable-pip-version-check", "--no-deps"]
    wheel += ["--no-build-isolation", "--wheel-dir", str(arguments.out), str(REPOSITORY / "bindings" / "python")]
    subprocess.run(wheel, check=True, env=environment)
    return arguments.out / f"vrtm-{arguments.version}-py3-none-{arguments.tag}.whl"


def pack(wheel: Path, arguments: argparse.Namespace) -> Path:
    script = REPOSITORY / "bindings" / "blender" / "build.py"
    subprocess.run([sys.executable, str(script), "--wheel", str(wheel), "--out", str(arguments.out)], check=True)
    return arguments.out / f"vrtm-{arguments.version}-{arguments.platform.replace('-', '_')}.zip"


def check_wheel(wheel: zipfile.ZipFile, arguments: argparse.Namespace) -> bytes:
    """Returns the library that is in it."""
    names = wheel.namelist()
    ours = "vrtm/vrtm.dll" if arguments.tag.startswith("win") else "vrtm/libvrtm.so"
    libraries = [name for name in names if Path(name).suffix in (".dll", ".so", ".dylib", ".pyd", ".a", ".lib")]
    assert libraries == [ours], libraries
    for name in ("vrtm/__init__.py", "vrtm/_abi.py", "vrtm/_records.py", "vrtm/py.typed", "vrtm/LICENSE-MIT"):
        assert name in names, name
    assert b"glam" in wheel.read("vrtm/THIRD-PARTY.txt")
    about = f"vrtm-{arguments.version}.dist-info"
    lines = wheel.read(f"{about}/WHEEL").decode().splitlines()
    assert f"Tag: py3-none-{arguments.tag}" in lines and "Root-Is-Purelib: false" in lines, lines
    needed = [
        line for line in wheel.read(f"{about}/METADATA").decode().splitlines() if line.startswith("Requires-Dist")
    ]
    assert any(line.startswith("Requires-Dist: numpy") for line in needed), needed
    library = wheel.read(ours)
    assert library == arguments.library.read_bytes()
    return library


def main() -> None:
    parser = argparse.ArgumentParser()
    for name in ("library", "out", "program"):
        parser.add_argument(f"--{name}", type=Path, required=True)
    for name in ("tag", "platform", "version"):
        parser.add_argument(f"--{name}", required=True)
    parser.add_argument("--run", default="")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    for path in arguments.out.iterdir():
        path.unlink()

    wheel = build(arguments)
    with zipfile.ZipFile(wheel) as archive:
        check_wheel(archive, arguments)
        abi: dict = {}
        exec(archive.read("vrtm/_abi.py"), abi)
    with zipfile.ZipFile(pack(wheel, arguments)) as archive:
        manifest = tomllib.loads(archive.read("blender_manifest.toml").decode())
        assert manifest["platforms"] == [arguments.platform], manifest["platforms"]
        assert manifest["wheels"] == [f"./wheels/{wheel.name}"], manifest["wheels"]
        with zipfile.ZipFile(io.BytesIO(archive.read(f"wheels/{wheel.name}"))) as inner:
            library = check_wheel(inner, arguments)
    path = arguments.out / ("vrtm.dll" if arguments.tag.startswith("win") else "libvrtm.so")
    path.write_bytes(library)
    run = [arguments.run] if arguments.run else []
    # Wine has this system's files in the drive Z.
    seen = "Z:" + str(path).replace("/", "\\") if run and arguments.tag.startswith("win") else str(path)
    found = subprocess.run(
        [*run, str(arguments.program), seen], input="\n".join(abi["functions"]), capture_output=True, text=True
    )
    assert found.returncode == 0, found.stdout + found.stderr
    print(found.stdout.strip())
    major, minor, patch = (int(part) for part in arguments.version.split("."))
    version = 1_000_000 * major + 1000 * minor + patch
    assert found.stdout.split() == [str(len(abi["functions"])), "functions,", "version", str(version)], found.stdout


if __name__ == "__main__":
    main()
